"""What is left of refits that may be the best."""

from types import SimpleNamespace

import pytest

from diagnosis.gap import contending


@pytest.fixture
def contend(monkeypatch):
    """``contend(here, anew, fresh)``: what is left of refits whose evidences are these, simulated anew and afresh."""

    def worth(name, value):
        lin = SimpleNamespace(problem=SimpleNamespace(name=name, floor=None), z=None, around=None)
        return SimpleNamespace(names=(name,), evidence=value, simulations=7, lin=lin)

    def made(here, anew, fresh, chosen=()):
        monkeypatch.setattr(contending, "settled", lambda problem, *_, **__: worth(problem.name, anew[problem.name]))

        def afresh(plain, one, *_):
            value = fresh.get(one.names[0])
            return None if value is None else worth(one.names[0], value)

        monkeypatch.setattr(contending, "fitted_afresh", afresh)
        stage = SimpleNamespace(grams=SimpleNamespace(observed=None), colours=SimpleNamespace(best={}))
        found = SimpleNamespace(path="here", made={}, simulations=0, chosen=chosen, plain=None, begin=None)
        refits = [worth(name, value) for name, value in here.items()]
        left, best = contending.contended(refits, stage, found, lambda _: None)
        return [(one.names[0], one.evidence) for one in left], (best.names[0], best.evidence), found.simulations

    return made


def test_refits_that_straight_lines_served_well_are_left_as_they_are(contend):
    left, best, count = contend({"a": -10.0, "b": -20.0}, {"a": -12.0}, {"b": 0.0})
    assert left == [("a", -10.0), ("b", -20.0)] and best == ("a", -12.0) and count == 7


def test_where_the_way_is_bent_the_foremost_are_fitted_afresh_and_the_best_of_these_wins(contend):
    here = {"a": -10.0, "b": -20.0, "c": -30.0, "d": -40.0}
    left, best, count = contend(here, {"a": -60.0, "c": -31.0}, {"a": -50.0, "b": -15.0, "d": 0.0})
    # c cannot be fitted afresh and counts as it is when simulated anew; d is one too many
    assert left == [("b", -15.0), ("c", -31.0), ("a", -50.0)] and best == left[0]
    assert count == 7 * 4  # a and c anew, a and b afresh


def test_what_straight_lines_put_far_behind_is_no_contender(contend):
    left, _, count = contend({"a": -10.0, "b": -61.0}, {"a": -60.0}, {"a": -50.0, "b": 0.0})
    assert left == [("a", -50.0)] and count == 7 * 2  # a anew and afresh, b neither


def test_a_second_effect_is_not_fitted_afresh(contend):
    left, best, _ = contend({"a": -10.0}, {"a": -60.0}, {"a": 0.0}, chosen=("first",))
    assert left == [("a", -10.0)] and best == ("a", -60.0)


def test_of_each_candidate_the_best_refit_is_left():
    ones = [SimpleNamespace(names=(name,), evidence=value) for name, value in [("a", 1.0), ("b", 2.0), ("a", 3.0)]]
    assert [(one.names[0], one.evidence) for one in contending.best_of(ones)] == [("a", 3.0), ("b", 2.0)]
