"""From evidence to probabilities and an answer."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.gap.evidence import Evidence
from diagnosis.gap.verdict import decide, probabilities
from tests.diagnosis.verdict_cases import BY

QUIET = Evidence(
    **{"replay": False, "counted": True, "gap": False, "searched": True, "rejected": False},
    **{"strained": False},
    **{"candidates": {"one": -1.0, "two": -2.0}, "beside": {}, "p_values": {}},
    **{"chosen": (), "before": 0.0, "left": 0.0},
)
LOUD = replace(QUIET, gap=True, candidates={"one": 50.0, "two": 48.0, "three": 1.0}, chosen=("one",), before=60.0)


def whole(done):
    assert done.none + done.nothing + sum(done.probabilities.values()) == pytest.approx(1.0)


def test_probabilities_are_those_of_a_conditional_logit():
    """By hand: the best candidate has odds of one, the others by the power of their evidence."""
    found = probabilities(LOUD, BY.nothing, BY.none, BY.power)
    odds = np.array([np.exp(3.0 - 2.0 - np.log1p(50.0)), np.exp(-1.0), 1.0, np.exp(-1.0), np.exp(-24.5)])
    expected = odds / odds.sum()
    assert [found.nothing, found.none, *found.causes.values()] == pytest.approx(expected.tolist())


def test_what_leaves_more_than_it_explains_is_no_cause():
    by = BY.model_copy(update={"none": {"one": -1.0}})
    explains = replace(LOUD, strained=True, rejected=True, before=100.0, left=45.0)
    assert (decide(explains, by).verdict, decide(explains, by).unlike) == ("ambiguous", False)
    # in a room that the description may be of, a candidate may act by a law of its own
    assert decide(replace(explains, left=58.0, strained=False), by).verdict == "ambiguous"
    done = decide(replace(explains, left=58.0), by)
    assert (done.verdict, done.named, done.unlike) == ("none_of_these", (), True)
    weighed = decide(replace(explains, left=58.0), BY.model_copy(update={"none": {"one": -1.0, "excess": 2.0}}))
    assert weighed.none / weighed.probabilities["one"] == pytest.approx(np.exp(-1.0) * 17.0**2)
    whole(done)
    assert decide(replace(explains, left=58.0, rejected=False), by).verdict == "ambiguous"
    assert done.nothing == decide(explains, by).nothing  # whether there is a gap is not asked again


def test_where_nothing_was_chosen_no_candidate_is_more_probable_than_none_of_them():
    by = BY.model_copy(update={"none": {"one": -1.0, "unexplained": 3.0}})
    done = decide(replace(LOUD, strained=True, rejected=True, chosen=(), before=60.0, left=60.0), by)
    assert (done.verdict, done.unlike) == ("none_of_these", True)
    assert done.none > 0.5 > max(done.probabilities.values())
    whole(done)


def test_without_candidates_the_cause_is_none_of_them_or_there_is_no_gap():
    found = probabilities(replace(QUIET, candidates={}), BY.nothing, BY.none, BY.power)
    assert found.causes == {}
    assert found.nothing + found.none == pytest.approx(1.0)
    assert decide(replace(LOUD, candidates={}, chosen=(), left=60.0), BY).verdict == "none_of_these"


@pytest.mark.parametrize(
    ("evidence", "verdict", "named"),
    [
        (QUIET, "no_gap", ()),
        (LOUD, "ambiguous", ("one", "two")),
        (replace(LOUD, candidates={"one": 50.0, "two": 30.0}), "effect", ("one",)),
        (replace(LOUD, candidates={"one": 30.0, "two": 50.0}), "ambiguous", ("two", "one")),  # what is told is in it
        (replace(LOUD, left=60.0, rejected=True), "none_of_these", ()),
        (replace(LOUD, chosen=()), "none_of_these", ()),
        (replace(LOUD, candidates={"one": 0.1}), "no_gap", ()),  # no gap is more probable than the limit
    ],
)
def test_the_answer_follows_the_probabilities_and_the_limits(evidence, verdict, named):
    done = decide(evidence, BY)
    assert (done.verdict, done.named) == (verdict, named)
    assert done.mistaken == pytest.approx(1 - sum(done.probabilities[name] for name in named))
    whole(done)


def test_what_is_rejected_is_no_answer_where_the_system_was_not_calibrated():
    doubted = replace(LOUD, rejected=True)
    assert decide(doubted, BY).named
    assert decide(doubted, BY, own=False).verdict == "none_of_these"
    assert decide(LOUD, BY, own=False) == decide(LOUD, BY)


def test_a_gap_whose_cause_nobody_looked_for_is_of_no_candidate():
    done = decide(replace(LOUD, searched=False), BY)
    assert (done.verdict, done.named, done.sets) == ("unfinished", (), ())
    whole(done)


def test_none_of_these_is_answered_where_it_is_more_probable_than_what_would_be_named():
    """Candidates that look alike share what is theirs, if all are named."""
    alike = replace(LOUD, candidates={f"{k}": 50.0 for k in range(4)}, chosen=("0",), left=6.0)
    done = decide(alike, BY.model_copy(update={"held": {"all": 0.05}}))
    assert max(done.probabilities.values()) < done.none < sum(done.probabilities.values())
    assert (done.verdict, done.or_none) == ("ambiguous", True)
    one = decide(alike, BY.model_copy(update={"held": {"all": done.none}}))
    assert (one.verdict, one.named) == ("none_of_these", ())
    assert decide(replace(alike, left=60.0), BY).verdict == "none_of_these"


def test_an_answer_of_none_of_these_says_what_it_does_not_rule_out():
    alike = replace(LOUD, candidates={"one": 50.0, "two": 49.0, "far": 5.0}, chosen=("one",), left=60.0)
    done = decide(alike, BY)
    least = done.probabilities["two"]
    by = BY.model_copy(update={"held": {"all": least}})
    assert decide(alike, by).possible == ("one", "two")
    assert (decide(alike, by).named, decide(alike, by).sets) == ((), ())
    by = BY.model_copy(update={"held": {"all": 1.01 * least}})
    assert decide(alike, by).possible == ("one",)
    assert decide(alike, by, own=False).possible == ()  # nobody knows what limits hold there


def test_a_condition_with_limits_of_its_own_is_held_to_them():
    others = BY.model_copy(update={"held": {"all": 0.2, "replay, counted": 0.999}})
    wide = decide(LOUD, BY)
    assert decide(LOUD, others) == wide
    assert len(decide(replace(LOUD, replay=True), others).named) == 1 < len(wide.named)
    assert decide(replace(LOUD, replay=True, counted=False), others).named == wide.named


def test_of_two_effects_the_second_is_as_sure_as_such_seconds_were():
    both = replace(
        LOUD, candidates={"one": 50.0, "three": 20.0}, beside={"two": 30.0, "three": 10.0}, chosen=("one", "two")
    )
    done = decide(both, BY)
    assert (done.verdict, done.sets) == ("effect", (("one",), ("two",)))
    assert done.probabilities["two"] == pytest.approx(BY.second, abs=0.001)
    alike = replace(both, beside={"two": 30.0, "three": 30.0})
    assert decide(alike, BY).sets == (("one",), ("two", "three"))
    nothing = dict.fromkeys(map(str, range(30)), 0.0)  # no better than the first alone: no second one
    wide = BY.model_copy(update={"held": {"all": 0.02}})
    assert decide(replace(both, beside={"two": 2.0} | nothing), wide).sets[1] == ("two",)
    whole(decide(replace(both, candidates={"one": 0.1}), BY))  # no gap: nothing of a second
