"""What the search tries, and what ends it at once."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.gap import search as searching
from diagnosis.gap.search import search


@pytest.mark.parametrize(
    ("gain", "misfits", "discrepancy", "confirmed"),
    [(2.9, False, False, False), (3.1, False, False, True), (-5.0, True, False, True), (-5.0, False, True, True)],
)
def test_a_refit_confirms_what_a_straight_line_found(monkeypatch, gain, misfits, discrepancy, confirmed):
    """The first candidate is chosen if its refit is strong evidence, or the residual alone says that there is a gap."""
    colours = SimpleNamespace(best={})
    before = SimpleNamespace(
        candidate_found=True,
        misfits=misfits,
        episodic=False,
        discrepancy=discrepancy,
        lin=SimpleNamespace(chosen=(), simulations=0, failed=()),
        grams=SimpleNamespace(evidence=lambda colours: 10.0),
        colours=colours,
    )
    chosen = (SimpleNamespace(name="one"),)
    after = SimpleNamespace(candidate_found=False, lin=SimpleNamespace(chosen=chosen), colours=colours)
    refit = SimpleNamespace(evidence=10.0 + gain, lin=SimpleNamespace(amplitudes=[1.0]))
    begun = SimpleNamespace(lin=SimpleNamespace(problem=None), simulations=0, evidence=0.0)
    stages = iter([before, after])
    monkeypatch.setattr(searching, "settled_base", lambda *_: begun)
    monkeypatch.setattr(searching, "applicable", lambda *_: ((), {}))
    monkeypatch.setattr(searching, "among", lambda *_: before.lin)
    monkeypatch.setattr(searching, "examine", lambda *_, **__: next(stages))
    monkeypatch.setattr(searching, "refitted", lambda *_: [refit])
    monkeypatch.setattr(searching, "contended", lambda refits, *_: (refits, refits[0]))
    monkeypatch.setattr(searching, "renewed_among", lambda *_: None)
    readings = np.ones((1, 2), dtype=bool)
    found = search(SimpleNamespace(converged=True, problem=None), (), readings, np.ones(1), tell=lambda _: None)
    assert found.confirmed == confirmed
    assert found.chosen == (chosen if confirmed else ())


@pytest.mark.parametrize("foremost", [None, 2, 7])
@pytest.mark.parametrize(("best", "near"), [(10.0, 4), (40.0, searching.MOST_REFITS)])
def test_what_stands_out_most_from_its_own_twins_is_refitted_however_much_others_gain(
    monkeypatch, foremost, best, near
):
    """Of a small gap the candidates within eight of the best are, of a large one those with half of its gain."""
    count = 9
    scan = SimpleNamespace(
        order=list(range(count)),
        evidence=np.linspace(best, best - 20.0, count),
        ratio=np.full(count, 30.0),
        foremost=foremost,
    )
    lin = SimpleNamespace(effects=[SimpleNamespace(name=f"effect {j}") for j in range(count)])
    stage = SimpleNamespace(scan=scan, lin=lin, grams=None, colours=SimpleNamespace(best={}))
    monkeypatch.setattr(searching, "linear_start", lambda *_: np.zeros(1))
    made = SimpleNamespace(evidence=1.0, simulations=0)
    tried = []
    monkeypatch.setattr(searching, "refit", lambda grams, best, start, effects: tried.append(effects[0].name) or made)
    searching.refitted(stage, lambda _: None, SimpleNamespace(path="here", made={}, simulations=0))
    among = list(range(near))
    if foremost == 7:
        among = [*among[: searching.MOST_REFITS - 1], 7]
    assert tried == [f"effect {j}" for j in among]


@pytest.fixture
def contend(monkeypatch):
    """``contend(here, anew, fresh)``: what is left of refits whose evidences are these, simulated anew and afresh."""

    def worth(name, value):
        lin = SimpleNamespace(problem=SimpleNamespace(name=name, floor=None), z=None, around=None)
        return SimpleNamespace(names=(name,), evidence=value, simulations=7, lin=lin)

    def made(here, anew, fresh, chosen=()):
        monkeypatch.setattr(searching, "settled", lambda problem, *_, **__: worth(problem.name, anew[problem.name]))

        def afresh(plain, one, *_):
            value = fresh.get(one.names[0])
            return None if value is None else worth(one.names[0], value)

        monkeypatch.setattr(searching, "fitted_afresh", afresh)
        stage = SimpleNamespace(grams=SimpleNamespace(observed=None), colours=SimpleNamespace(best={}))
        found = SimpleNamespace(path="here", made={}, simulations=0, chosen=chosen, plain=None, begin=None)
        refits = [worth(name, value) for name, value in here.items()]
        left, best = searching.contended(refits, stage, found, lambda _: None)
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


def test_what_was_made_at_one_optimum_is_not_taken_for_another():
    """An effect that was fitted afresh, and the same one where its refit came to, with fewer candidates beside it."""

    def path(z):
        lin = SimpleNamespace(chosen=(SimpleNamespace(name="one"),), z=np.array(z))
        stage = SimpleNamespace(lin=lin, colours=SimpleNamespace(best={0: (1.0, 0.0, 1.0)}))
        return searching.Search([stage], base=None, plain=None).path

    assert path([0.5, 1.0]) == path([0.5, 1.0])
    assert path([0.5, 1.0]) != path([0.5, 1.1])
