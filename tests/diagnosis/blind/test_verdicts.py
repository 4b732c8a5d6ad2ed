"""What a score sees of a verdict."""

import pytest

from diagnosis.blind.running import contenders
from diagnosis.blind.verdicts import Verdict


def test_what_every_candidate_has_alike_is_no_reason_to_diagnose_again():
    """Of four candidates the evidence points to one; that it is mistaken gives each of them five per cent more."""
    said = {"a": 0.55, "b": 0.05, "c": 0.05, "d": 0.07}
    one = Verdict(verdict="effect", probabilities=said, none=0.25, nothing=0.04, mistaken=0.49, named=["a"])
    assert one.pointed == pytest.approx({"a": 0.5, "b": 0.0, "c": 0.0, "d": 0.02})
    assert contenders(one) == ["a", "d"]
    rejected = {"verdict": "none_of_these", "named": [], "chosen": ["b"], "mistaken": 0.6}
    assert contenders(one.model_copy(update=rejected)) == ["a", "b", "d"]  # its fit is what was rejected


def test_where_there_is_no_gap_nothing_is_diagnosed_again():
    said = {"a": 0.3, "b": 0.1}
    assert contenders(Verdict(verdict="no_gap", probabilities=said, none=0.2, nothing=0.4, mistaken=0.0)) == []
