"""Candidates weighed against one another, and what is named of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap.search import MOST_NAMES, told
from diagnosis.gap.weighing import COVER, SURE, TEMPER, named, softmax, weighed

EFFECTS = ("one", "two", "three")


def stage(*evidence, failed=()):
    effects = [SimpleNamespace(name=f"{j}") for j in range(len(evidence))]
    return SimpleNamespace(
        lin=SimpleNamespace(effects=effects, failed=failed),
        scan=SimpleNamespace(evidence=np.array(evidence)),
        discrepant={},
    )


def refits(**evidence):
    made = [
        SimpleNamespace(names=("before", name[1:]), evidence=value, evidence_with=lambda colours, value=value: value)
        for name, value in evidence.items()
    ]
    return sorted(made, key=lambda one: -one.evidence_with({}))


def test_probabilities_are_the_tempered_evidences():
    found = softmax({"one": -1000.0, "two": -1000.0 - TEMPER * np.log(3)})
    assert found == pytest.approx({"one": 0.75, "two": 0.25})
    assert softmax({}) == {}


def test_what_was_not_refitted_gains_what_refits_gained_and_is_no_better_than_the_last_of_them():
    found = weighed(stage(9.0, 8.0, 6.5, 2.0), refits(_0=-3.0, _1=-5.0), stage())
    weight = np.exp(np.array([-3.0, -5.0, -6.0, -10.5]) / TEMPER)  # by -12.5 in the middle
    assert list(found.values()) == pytest.approx(weight / weight.sum())
    capped = weighed(stage(9.0, 8.0, 7.9), refits(_0=5.0, _1=-3.0), stage())
    assert capped["2"] == pytest.approx(capped["1"])


def test_what_was_looked_at_and_not_refitted_is_as_far_behind_as_it_was():
    """The straight line had put it first."""
    found = weighed(stage(9.0, 30.0), refits(_0=100.0), stage(), tried=refits(_0=-3.0, _1=-63.0))
    weight = np.exp(np.array([100.0, 40.0]) / TEMPER)
    assert list(found.values()) == pytest.approx(weight / weight.sum())


def test_what_was_found_beside_a_candidate_is_no_alternative_to_it():
    found = weighed(stage(9.0, 8.0, 6.5), refits(_0=-3.0, _1=1.0), stage(), later=["1"])
    weight = np.exp(np.array([-3.0, -3.0]) / TEMPER)  # 6.5 - 9.5 is just what the last has
    assert found == pytest.approx(dict(zip(("0", "2"), weight / weight.sum(), strict=True)))


@pytest.mark.parametrize("how", ["excluded", "failed"])
def test_what_could_not_be_tried_is_no_alternative(how):
    """A signature that was not simulated has no evidence against it, and would stand before what was found wrong."""
    before = stage(9.0, 8.0, 9.0, failed=("2",) if how == "failed" else ())
    found = weighed(before, refits(_0=-3.0, _1=-5.0), stage(), excluded={"2": "why"} if how == "excluded" else ())
    weight = np.exp(np.array([-3.0, -5.0]) / TEMPER)
    assert found == pytest.approx(dict(zip(("0", "1"), weight / weight.sum(), strict=True)))
    assert set(weighed(before, refits(_0=-3.0, _2=-5.0), stage(), excluded=["2"])) == {"0", "1", "2"}


@pytest.mark.parametrize(
    ("chance", "chosen", "expected"),
    [
        ((SURE, 1 - SURE, 0.0), "one", ("one",)),
        ((SURE - 0.01, COVER - SURE + 0.01, 1 - COVER), "one", ("one", "two")),
        ((0.4, 0.35, 0.25), "one", ("one", "two", "three")),
        ((0.97, 0.02, 0.01), "three", ("one", "three")),
    ],
)
def test_the_smallest_set_that_covers_is_named_and_what_was_chosen_is_in_it(chance, chosen, expected):
    assert named(dict(zip(EFFECTS, chance, strict=True)), chosen) == expected


@pytest.mark.parametrize(("alike", "is_told"), [(MOST_NAMES - 1, True), (MOST_NAMES + 3, False)])
def test_a_further_effect_that_could_be_any_of_many_is_not_named(alike, is_told):
    after = stage(*[5.0] * alike, *[-90.0] * (20 - alike))
    assert told(after, refits(_0=-1.0), stage()) is is_told
