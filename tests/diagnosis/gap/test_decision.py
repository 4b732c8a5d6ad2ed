"""The rules between the search and the answer, on searches made up for the purpose."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap.decision import (
    AFTER_ALL,
    BESIDE,
    HALF,
    LEAST,
    NOTHING,
    OUTSIDE,
    STEEP,
    UNSEEN_OUTSIDE,
    decide,
    mistaken_by,
)
from diagnosis.gap.search import PARSIMONY, worth_more
from diagnosis.gap.weighing import TEMPER

EFFECTS = ("one", "two", "three")


def stage(
    *,
    found=True,
    misfits=True,
    episodic=False,
    left_over=100.0,
    chosen=(),
    evidence=(50.0, 48.0, 1.0),
    p=0.0025,
    misfit_p=None,
    replay=False,
):
    effects = tuple(SimpleNamespace(name=name) for name in EFFECTS if name not in chosen)
    return SimpleNamespace(
        candidate_found=found,
        misfits=misfits,
        episodic=episodic,
        discrepancy=left_over > 3 or episodic,
        left_over=left_over,
        discrepant={},
        lin=SimpleNamespace(effects=effects, failed=(), chosen=chosen, problem=SimpleNamespace(replay=replay)),
        scan=SimpleNamespace(
            evidence=np.array(evidence[: len(effects)]), p_value=p, misfit_p=p if misfit_p is None else misfit_p
        ),
    )


def refits(**evidence):
    return [
        SimpleNamespace(names=(name,), evidence=value, evidence_with=lambda colours, value=value: value)
        for name, value in sorted(evidence.items(), key=lambda item: -item[1])
    ]


def searched(stages, made, confirmed=True, to_the_end=True):
    share = stages[-1].left_over / max(stages[0].left_over, 1.0)
    chosen = stages[-1].lin.chosen
    return SimpleNamespace(
        stages=stages,
        refits=made,
        tried=made,
        last=stages[-1],
        chosen=chosen,
        share_left=share,
        confirmed=confirmed,
        excluded={},
        failed={},
        searched=to_the_end,
    )


def test_nothing_significant_is_no_gap_and_probabilities_sum_to_one():
    only = stage(found=False, misfits=False, left_over=1.0, p=0.5, evidence=(0.0, 0.0, 0.0))
    done = decide(searched([only], []), 0.5, 0.5)
    assert done.verdict == "no_gap"
    assert done.mistaken == pytest.approx(done.none + done.nothing)
    assert done.nothing == pytest.approx(NOTHING * 25 / 26)
    assert done.nothing + done.none + sum(done.probabilities.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("p", "misfit_p", "confirmed", "odds"),
    [(0.5, 0.1, True, 5.0), (0.04, 0.5, True, 2.0), (0.0025, 0.5, False, 1.0), (0.0025, 0.01, False, 0.5)],
)
def test_how_likely_nothing_is_follows_the_least_p(p, misfit_p, confirmed, odds):
    """Odds are the p in units of 0.02, the level; a candidate that no refit confirms is no better than at the level."""
    only = stage(found=not confirmed, misfits=False, left_over=1.0, p=p, misfit_p=misfit_p)
    done = decide(searched([only], [], confirmed=confirmed), 0.5, 0.5)
    assert done.verdict == "no_gap"
    assert done.nothing == pytest.approx(NOTHING * odds / (1 + odds))
    assert done.none == pytest.approx(UNSEEN_OUTSIDE * (1 - done.nothing))


@pytest.mark.parametrize(
    ("left_over", "p", "verdict"),
    [(100.0, 0.01, "none_of_these"), (0.0, 0.01, "no_gap"), (100.0, 0.015, "no_gap")],
)
def test_a_place_alone_is_a_gap_without_a_cause_if_a_discrepancy_is_plausible(left_over, p, verdict):
    """At half the level of 0.02."""
    only = stage(found=False, misfits=False, left_over=left_over)
    assert decide(searched([only], []), p, p).verdict == verdict


def test_a_gap_whose_cause_nobody_looked_for_is_of_no_candidate_and_of_each_as_straight_lines_say():
    only = stage(found=True, misfits=True, left_over=100.0, evidence=(9.0, 3.0, 0.0))
    done = decide(searched([only], [], to_the_end=False), 0.5, 0.5)
    assert (done.verdict, done.named, done.sets) == ("unfinished", (), ())
    assert done.nothing + done.none + sum(done.probabilities.values()) == pytest.approx(1.0)
    assert list(done.probabilities) == sorted(done.probabilities, key=lambda name: -done.probabilities[name])


def test_an_episode_alone_is_a_gap_without_a_cause():
    only = stage(found=False, misfits=False, episodic=True, left_over=0.0)
    assert decide(searched([only], []), 0.5, 0.5).verdict == "none_of_these"


@pytest.mark.parametrize(("misfits", "verdict"), [(False, "no_gap"), (True, "none_of_these")])
def test_a_candidate_that_no_refit_confirms_is_no_gap_by_itself(misfits, verdict):
    only = stage(found=True, misfits=misfits, left_over=0.0)
    done = decide(searched([only], [], confirmed=False), 0.5, 0.5)
    assert done.verdict == verdict
    assert done.nothing + done.none + sum(done.probabilities.values()) <= 1.0 + 1e-9
    assert decide(searched([only], []), 0.5, 0.5).verdict == "none_of_these"


def test_the_cause_that_is_far_better_is_named_alone():
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one",))
    done = decide(searched([stage(), after], [refits(one=0.0, two=-9.0)]), 0.002, 0.5)
    assert (done.verdict, done.named) == ("effect", ("one",))
    # the third was not refitted: it is as far behind the worst refit as the straight line has it
    weights = np.exp(np.array([0.0, -9.0, -9.0 - 47.0]) / TEMPER)
    even = (1 - OUTSIDE - AFTER_ALL) * LEAST[False] / 3
    assert done.probabilities["one"] == pytest.approx((1 - LEAST[False]) * weights[0] / weights.sum() + even)
    whole(done)


def whole(done):
    """A single cause is some candidate, or none of them, or there is no gap; most mistakes are causes outside."""
    assert done.none + done.nothing + sum(done.probabilities.values()) == pytest.approx(1.0)
    assert done.none == pytest.approx(OUTSIDE * done.mistaken)
    assert done.nothing == pytest.approx(AFTER_ALL * done.mistaken)


def test_an_answer_that_is_not_rejected_is_as_sure_as_such_answers_were():
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one",))
    done = decide(searched([stage(), after], [refits(one=0.0, two=-90.0)]), 0.002, 0.5)
    assert (done.named, done.rejected) == (("one",), False)
    assert done.mistaken == pytest.approx(LEAST[False])
    assert 1 - LEAST[False] < done.probabilities["one"] < 1 - LEAST[False] * (OUTSIDE + AFTER_ALL)
    assert done.probabilities["two"] == pytest.approx((1 - OUTSIDE - AFTER_ALL) * LEAST[False] / 3)
    whole(done)


@pytest.mark.parametrize("left_over", [0.0, 5.0, 60.0])
def test_a_rejected_answer_is_less_sure_the_more_is_left(left_over):
    after = stage(found=False, misfits=True, left_over=left_over, chosen=("one",))
    done = decide(searched([stage(), after], [refits(one=0.0, two=-90.0)]), 0.002, 0.5)
    assert done.rejected
    other = 1 / (1 + np.exp(-(left_over / 100 - HALF) / STEEP))
    assert done.mistaken == pytest.approx(LEAST[False] + (1 - LEAST[False]) * other)
    assert (done.verdict == "none_of_these") is (done.mistaken > 0.5) is (done.named == ())
    whole(done)


def test_a_candidate_that_could_not_be_tried_has_no_share_of_a_mistake():
    search = searched([stage()], [])
    search.excluded["three"] = "its simulation fails"
    done = decide(search, 0.002, 0.002)
    assert done.probabilities.get("three", 0.0) == 0.0
    assert done.probabilities["one"] == done.probabilities["two"] > 0
    whole(done)


def test_a_candidate_that_could_not_be_tried_is_neither_probable_nor_in_a_set():
    only = stage(found=False, misfits=False, left_over=1.0, p=0.5, evidence=(0.0, 0.0, 9.0))
    quiet = searched([only], [])
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one",))
    loud = searched([stage(evidence=(50.0, 30.0, 50.0)), after], [refits(one=0.0, two=-20.0)])
    for search, p in ((quiet, 0.5), (loud, 0.002)):
        search.excluded["three"] = "its simulation fails"
        done = decide(search, p, 0.5)
        assert done.probabilities.get("three", 0.0) == 0.0
        assert "three" not in done.named
        assert done.nothing + done.none + sum(done.probabilities.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("excluded", [False, True])
@pytest.mark.parametrize(("misfits", "verdict"), [(False, "no_gap"), (True, "none_of_these")])
def test_without_candidates_the_cause_is_none_of_them_or_there_is_no_gap(monkeypatch, excluded, misfits, verdict):
    if not excluded:
        monkeypatch.setitem(globals(), "EFFECTS", ())
    only = stage(found=False, misfits=misfits, left_over=1.0, p=0.5, evidence=(0.0, 0.0, 0.0))
    search = searched([only], [])
    search.excluded |= dict.fromkeys(EFFECTS if excluded else (), "its simulation fails")
    done = decide(search, 0.5, 0.5)
    assert done.verdict == verdict
    assert sum(done.probabilities.values()) == 0.0
    assert done.nothing + done.none == pytest.approx(1.0)


def test_where_no_candidate_was_good_for_anything_all_are_alike():
    """Three in five such causes in opened sets were outside the library, and no more: none of these is not certain."""
    done = decide(searched([stage()], []), 0.002, 0.002)
    assert (done.verdict, done.mistaken) == ("none_of_these", 1.0)
    assert len(set(done.probabilities.values())) == 1
    assert done.none > max(done.probabilities.values())
    whole(done)


def test_causes_that_are_equally_good_are_a_set():
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one",))
    done = decide(searched([stage(), after], [refits(one=0.0, two=-0.5)]), 0.002, 0.5)
    assert (done.verdict, set(done.named)) == ("ambiguous", {"one", "two"})


@pytest.mark.parametrize(("left_over", "verdict"), [(5.0, "effect"), (80.0, "none_of_these")])
def test_a_rejected_fit_is_none_of_these_only_if_much_is_left(left_over, verdict):
    """A cause of another form than its candidate leaves something; a cause that is no candidate leaves much."""
    after = stage(found=False, misfits=True, left_over=left_over, chosen=("one",))
    done = decide(searched([stage(), after], [refits(one=0.0, two=-90.0)]), 0.002, 0.002)
    assert done.rejected
    assert done.verdict == verdict


def test_two_effects_are_both_named():
    middle = stage(left_over=50.0, chosen=("one",), evidence=(20.0, 1.0))
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one", "two"))
    search = searched([stage(), middle, after], [refits(one=0.0, two=-29.0), refits(two=0.0, three=-29.0)])
    done = decide(search, 0.002, 0.4)
    assert (done.verdict, done.named) == ("effect", ("one", "two"))


def test_effects_that_act_together_are_those_that_were_fitted_together():
    """Alone, the second looks more like the whole gap than the first; beside it, it is no alternative to it."""
    middle = stage(left_over=50.0, chosen=("one",), evidence=(20.0, 1.0))
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one", "two"))
    search = searched([stage(), middle, after], [refits(one=0.0, two=-29.0), refits(two=0.0, three=-29.0)])
    for one, value in zip(search.refits[0], (0.0, 9.0), strict=True):
        one.evidence_with = lambda colours, value=value: value
    done = decide(search, 0.002, 0.4)
    assert (done.verdict, done.sets) == ("effect", (("one",), ("two",)))


def test_each_of_two_effects_is_less_sure_than_that_not_both_are_mistaken():
    """And what may be the one or the other has the sum of both chances."""
    middle = stage(left_over=50.0, chosen=("one",), evidence=(20.0, 1.0))
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one", "two"))
    search = searched([stage(), middle, after], [refits(one=0.0, three=-9.0), refits(two=0.0, three=-9.0)])
    done = decide(search, 0.002, 0.4)
    even = (done.mistaken - done.none - done.nothing) / len(EFFECTS)
    three = np.exp(-9.0 / TEMPER) / (1 + np.exp(-9.0 / TEMPER))
    each = (1 - done.mistaken) * BESIDE
    assert done.named == ("one", "two")
    assert done.probabilities["one"] == pytest.approx(each * (1 - three) + even)
    assert done.probabilities["one"] < 1 - done.mistaken
    assert done.probabilities["three"] == pytest.approx(2 * each * three + even)


@pytest.mark.parametrize(("left_over", "worth"), [(0.99 * PARSIMONY, True), (1.01 * PARSIMONY, False)])
def test_a_further_effect_must_leave_clearly_less(left_over, worth):
    assert worth_more(SimpleNamespace(left_over=60.0), SimpleNamespace(left_over=60.0 * left_over)) is worth


@pytest.mark.parametrize(("replay", "share"), [(False, 0.25), (True, 0.15)])
def test_a_rejected_fit_is_as_likely_right_as_wrong_where_the_documents_say(replay, share):
    """docs/diagnosis.md and docs/blind-check.md. HALF is of the curve alone."""
    assert mistaken_by(share, True, replay) == pytest.approx(0.5, abs=0.01)
    assert mistaken_by(0.0, False, replay) == LEAST[replay] < 0.5 < mistaken_by(HALF, True, replay)


def test_how_probable_none_of_these_is_at_most_stands_in_the_documents():
    most = f"{OUTSIDE:.0%} at most ({1 - AFTER_ALL:.0%} where no candidate could be tried)".replace("%", " %")
    assert most in " ".join(Path("docs/report.md").read_text(encoding="utf-8").split())


def test_with_replayed_actuators_an_answer_is_less_sure():
    after = stage(found=False, misfits=False, left_over=0.0, chosen=("one",), replay=True)
    done = decide(searched([stage(replay=True), after], [refits(one=0.0, two=-90.0)]), 0.002, 0.5)
    assert done.mistaken == pytest.approx(LEAST[True])
    assert LEAST[True] > LEAST[False]
    whole(done)
