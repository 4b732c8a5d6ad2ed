"""What a search says for and against each answer."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap.evidence import evidence_of, gap_found, worth
from diagnosis.gap.search import CLEAR, MOST_NAMES, PARSIMONY, told, worth_more


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


ALONE = SimpleNamespace(evidence_with=lambda colours: -10.0)


def test_what_was_not_refitted_gains_what_refits_gained_and_is_no_better_than_the_last_of_them():
    found = worth(stage(9.0, 8.0, 6.5, 2.0), refits(_0=-3.0, _1=-5.0), stage())
    assert found == {"0": -3.0, "1": -5.0, "2": -6.0, "3": -10.5}  # by -12.5 in the middle
    assert worth(stage(9.0, 8.0, 7.9), refits(_0=5.0, _1=-3.0), stage())["2"] == -3.0


def test_evidence_is_over_the_base_model_that_was_fitted_as_they_were():
    assert worth(stage(9.0), refits(_0=-3.0), stage(), base=ALONE) == {"0": 7.0}


def test_what_was_looked_at_and_not_refitted_is_as_far_behind_as_it_was():
    """The straight line had put it first."""
    found = worth(stage(9.0, 30.0), refits(_0=100.0), stage(), tried=refits(_0=-3.0, _1=-63.0))
    assert found == {"0": 100.0, "1": 40.0}


def test_what_was_found_beside_a_candidate_is_no_alternative_to_it():
    found = worth(stage(9.0, 8.0, 6.5), refits(_0=-3.0, _1=1.0), stage(), later=["1"])
    assert found == {"0": -3.0, "2": -3.0}  # 6.5 - 9.5 is just what the last has


@pytest.mark.parametrize("how", ["excluded", "failed"])
def test_what_could_not_be_tried_is_no_alternative(how):
    """A signature that was not simulated has no evidence against it, and would stand before what was found wrong."""
    before = stage(9.0, 8.0, 9.0, failed=("2",) if how == "failed" else ())
    found = worth(before, refits(_0=-3.0, _1=-5.0), stage(), excluded={"2": "why"} if how == "excluded" else ())
    assert found == {"0": -3.0, "1": -5.0}
    assert set(worth(before, refits(_0=-3.0, _2=-5.0), stage(), excluded=["2"])) == {"0", "1", "2"}


@pytest.mark.parametrize(("alike", "is_told"), [(MOST_NAMES - 1, True), (MOST_NAMES + 3, False)])
def test_a_further_effect_that_could_be_any_of_many_is_not_named(alike, is_told):
    near, far = 0.9 * CLEAR, 1.1 * CLEAR
    after = stage(9.0, *[9.0 - near] * (alike - 1), *[9.0 - far] * (20 - alike))
    assert told(after, refits(_0=-1.0), stage(), ALONE) is is_told


def test_a_further_effect_that_is_no_better_than_the_first_alone_is_not_named():
    """With the error that both leave: with that of the first alone it was better."""
    after = stage(9.0, 1.0)
    assert told(after, refits(_0=-10.0 + CLEAR), stage(), ALONE)
    assert not told(after, refits(_0=-10.1 + CLEAR), stage(), ALONE)


@pytest.mark.parametrize(("left_over", "worth_it"), [(0.99 * PARSIMONY, True), (1.01 * PARSIMONY, False)])
def test_a_further_effect_must_leave_clearly_less(left_over, worth_it):
    assert worth_more(SimpleNamespace(left_over=60.0), SimpleNamespace(left_over=60.0 * left_over)) is worth_it


@pytest.mark.parametrize(
    ("seen", "p", "confirmed", "expected"),
    [
        ("candidate_found", 0.5, True, True),
        ("candidate_found", 0.5, False, False),  # no refit shows what the straight line does
        ("misfits", 0.5, False, True),
        ("discrepancy", 0.01, True, True),  # a place, where a discrepancy is plausible, too
        ("discrepancy", 0.015, True, False),
        ("", 0.01, True, False),
    ],
)
def test_a_gap_is_told_by_a_candidate_a_misfit_or_a_place(seen, p, confirmed, expected):
    names = ("candidate_found", "misfits", "episodic", "discrepancy")
    assert gap_found(SimpleNamespace(**{name: name == seen for name in names}), p, confirmed) is expected


@pytest.mark.parametrize(("at_bound", "strained"), [((), False), (("floor",), False), (("floor", "height"), True)])
def test_a_fit_is_strained_by_parameters_at_their_ends_and_not_by_constants(at_bound, strained):
    problem = SimpleNamespace(
        replay=False, nuisance=SimpleNamespace(levels=()), system=SimpleNamespace(parameter_names=["height"])
    )
    scan = SimpleNamespace(evidence=np.array([]), p_value=1.0, misfit_p=1.0)
    first = SimpleNamespace(
        lin=SimpleNamespace(problem=problem, effects=(), chosen=()), scan=scan, episode=None, left_over=8.0
    )
    search = SimpleNamespace(
        **{"stages": [first], "last": first, "excluded": {}, "failed": {}, "refits": [], "compared": None},
        **{"base": SimpleNamespace(at_bound=at_bound), "searched": True},
    )
    found = evidence_of(search, gap=True, rejected=True, where_p=1.0)
    assert (found.strained, found.excess) == (strained, 8.0 if strained else 0.0)
