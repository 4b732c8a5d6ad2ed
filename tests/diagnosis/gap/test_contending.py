"""What is left of refits that may be the best."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.effects.base import Nothing
from diagnosis.gap import contending
from diagnosis.gap import search as searching
from diagnosis.gap.abroad import Abroad
from diagnosis.gap.made import Made


@pytest.fixture
def contend(monkeypatch):
    """``contend(here, anew, fresh)``: what is left of refits whose evidences are these, simulated anew and afresh.

    And the best, the simulations, and where the base model was fitted.
    """
    laid = []

    def worth(name, value):
        lin = SimpleNamespace(problem=SimpleNamespace(name=name, floor=None), z=None, around=None)
        return SimpleNamespace(names=(name,), evidence=value, simulations=7, lin=lin)

    def made(here, anew, fresh, chosen=()):
        monkeypatch.setattr(contending, "settled", lambda problem, *_, **__: worth(problem.name, anew[problem.name]))

        def afresh(plain, one, *_):
            value = fresh.get(one.names[0])
            return None if value is None else worth(one.names[0], value)

        monkeypatch.setattr(contending, "fitted_afresh", afresh)
        monkeypatch.setattr(contending, "laid_bare", lambda one, *_: laid.append((one.names[0], one.evidence)))
        stage = SimpleNamespace(grams=SimpleNamespace(observed=None), colours=SimpleNamespace(best={}))
        found = SimpleNamespace(path="here", made=Made(), simulations=0, chosen=chosen, plain=None, begin=None)
        refits = [worth(name, value) for name, value in here.items()]
        left, best = contending.contended(refits, stage, found, lambda _: None)
        return [(one.names[0], one.evidence) for one in left], (best.names[0], best.evidence), found.simulations, laid

    return made


def test_refits_that_straight_lines_served_well_are_left_as_they_are(contend):
    left, best, count, laid = contend({"a": -10.0, "b": -20.0}, {"a": -12.0}, {"b": 0.0})
    assert left == [("a", -10.0), ("b", -20.0)] and best == ("a", -12.0) and count == 7
    assert laid == []


def test_where_the_way_is_bent_the_foremost_are_fitted_afresh_and_the_best_of_these_wins(contend):
    here = {"a": -10.0, "b": -20.0, "c": -30.0, "d": -40.0}
    left, best, count, laid = contend(here, {"a": -4.0, "c": -31.0}, {"a": -2.0, "b": -1.0, "d": 0.0})
    # c cannot be fitted afresh; d is one too many
    assert left == [("b", -1.0), ("a", -2.0), ("c", -30.0)] and best == left[0]
    assert count == 7 * 4  # a and c anew, a and b afresh
    assert laid == [("a", -2.0), ("b", -1.0), ("c", -31.0)]


def test_a_candidate_is_worth_what_it_is_where_it_is_most_plausible(contend):
    """What goes on is simulated anew, also where straight lines had led to a better place than the fit afresh."""
    left, best, _, _ = contend({"a": -10.0, "b": -20.0}, {"a": -60.0, "b": -70.0}, {"a": -50.0, "b": -15.0})
    assert left == [("a", -10.0), ("b", -15.0)] and best == ("a", -50.0)


def test_what_straight_lines_put_far_behind_is_no_contender(contend):
    left, _, count, _ = contend({"a": -10.0, "b": -61.0}, {"a": -60.0}, {"a": -50.0, "b": 0.0})
    assert left == [("a", -10.0)] and count == 7 * 2  # a anew and afresh, b neither


def test_a_second_effect_is_not_fitted_afresh(contend):
    left, best, _, laid = contend({"a": -10.0}, {"a": -60.0}, {"a": 0.0}, chosen=("first",))
    assert left == [("a", -10.0)] and best == ("a", -60.0) and laid == []


@pytest.mark.parametrize(
    ("raw", "there", "asked", "stands"),
    [
        (12.9, 10.0, True, False),  # of a base model worth 10
        (13.1, 10.0, True, True),
        (59.0, 57.0, True, False),
        (61.0, 99.0, False, True),  # by far
    ],
)
def test_a_first_effect_stands_if_the_base_model_does_worse_there_too(monkeypatch, raw, there, asked, stands):
    laid = []

    def lay(one, stage, found):
        laid.append(one)
        found.bare.append(SimpleNamespace(evidence=there))

    monkeypatch.setattr(contending, "laid_bare", lay)
    stage = SimpleNamespace(grams=SimpleNamespace(evidence=lambda _: 10.0), colours=SimpleNamespace(best={}))
    for refit, best in ((raw, -50.0), (-50.0, raw)):
        found = SimpleNamespace(last=stage, settled=[], bare=[])
        ones = [SimpleNamespace(evidence=refit)]
        assert contending.stands(ones, SimpleNamespace(evidence=best), stage, found) == stands
        assert bool(laid) == asked


def test_the_base_model_is_fitted_once_where_a_refit_lies(monkeypatch):
    made = []

    def lay(one, base, colours):
        made.append((one, base, colours))
        return [SimpleNamespace(simulations=40, evidence=3.0), SimpleNamespace(simulations=2, evidence=4.0)]

    monkeypatch.setattr(contending, "bare", lay)
    one = SimpleNamespace(names=("a",), lin=SimpleNamespace(z=np.zeros(2)))
    grams = SimpleNamespace(evidence=lambda _: -30.0)
    stage = SimpleNamespace(grams=grams, colours=SimpleNamespace(best={0: "white"}))
    found = SimpleNamespace(path="here", made=Made(), simulations=0, base="base", bare=[], last=stage, settled=[])
    assert contending.evidence_before(found) == -30.0
    for _ in range(2):
        contending.laid_bare(one, stage, found)
    assert made == [(one, "base", {0: "white"})] and found.simulations == 42
    assert contending.evidence_before(found) == 4.0 and len(found.bare) == 4


def test_of_each_candidate_the_best_refit_is_left():
    ones = [SimpleNamespace(names=(name,), evidence=value) for name, value in [("a", 1.0), ("b", 2.0), ("a", 3.0)]]
    assert [(one.names[0], one.evidence) for one in contending.best_of(ones)] == [("a", 3.0), ("b", 2.0)]


def test_those_foremost_where_the_fit_began_are_fitted_from_there_once(monkeypatch):
    """And of a search with fewer candidates only those that it still has."""
    effects = [Nothing(name) for name in ("a", "b", "c", "d")]
    begins = tuple(np.full(2, 0.1 * k) for k in range(4))
    seen = Abroad(tuple(effects), (1.0, 2.0, 3.0, 4.0), begins, (-5.0, -6.0, -7.0, -8.0), 100)
    looked, fitted = [], []
    monkeypatch.setattr(contending, "abroad", lambda *_: looked.append(1) or seen)

    def fit(plain, one, amplitudes, observed, colours, begin):
        assert begin is begins[effects.index(one[0])]  # where its own refit came to
        fitted.append((one[0].name, *amplitudes))
        worth = {"b": 5.0, "c": 7.0, "d": 1.0}.get(one[0].name)  # a cannot be simulated
        return None if worth is None else SimpleNamespace(names=(one[0].name,), evidence=worth, simulations=10)

    monkeypatch.setattr(contending, "fitted_with", fit)
    monkeypatch.setattr(contending, "laid_bare", lambda *_: None)
    plain = SimpleNamespace(with_effects=lambda _: SimpleNamespace(size=2))
    found = SimpleNamespace(path="here", made=Made(), simulations=0, plain=plain, begin=None, failed={})

    def refits(names):
        lin = SimpleNamespace(effects=[one for one in effects if one.name in names])
        stage = SimpleNamespace(lin=lin, grams=SimpleNamespace(observed=None), colours=SimpleNamespace(best={}))
        made, ranked = contending.fitted_abroad(stage, found, lambda _: None)
        return [one.names[0] for one in made], [one.names[0] for one in ranked]

    assert refits("abcd") == (["c", "b"], ["a", "b", "c", "d"])
    assert fitted == [("a", 1.0), ("b", 2.0), ("c", 3.0)] and found.simulations == 100 + 2 * 10
    assert refits("abd") == (["b", "d"], ["a", "b", "d"])
    assert fitted[3:] == [("d", 4.0)] and len(looked) == 1


def test_an_effect_may_be_called_as_what_a_search_makes(monkeypatch):
    """What all candidates are worth where the fit began is not taken for the refit of an effect of such a name."""
    effect = Nothing("abroad")
    lin = SimpleNamespace(amplitudes=[1.0])
    one = SimpleNamespace(names=("abroad",), evidence=2.0, simulations=3, lin=lin)
    monkeypatch.setattr(contending, "abroad", lambda *_: Abroad((effect,), (1.0,), (np.zeros(2),), (-5.0,), 100))
    monkeypatch.setattr(contending, "fitted_with", lambda *_: one)
    monkeypatch.setattr(contending, "laid_bare", lambda *_: None)
    plain = SimpleNamespace(with_effects=lambda _: SimpleNamespace(size=2))
    found = SimpleNamespace(path="here", made=Made(), simulations=0, plain=plain, begin=None, failed={})
    scan = SimpleNamespace(order=[0], evidence=np.array([9.0]), ratio=np.array([9.0]), foremost=None)
    stage = SimpleNamespace(
        scan=scan,
        lin=SimpleNamespace(effects=[effect]),
        grams=SimpleNamespace(observed=None),
        colours=SimpleNamespace(best={}),
    )
    _, ranked = contending.fitted_abroad(stage, found, lambda _: None)
    monkeypatch.setattr(searching, "linear_start", lambda *_: np.zeros(1))
    monkeypatch.setattr(searching, "refit", lambda *_: one)
    assert searching.refitted(stage, lambda _: None, found) == [one]
    assert contending.fitted_abroad(stage, found, lambda _: None) == ([one], ranked)
