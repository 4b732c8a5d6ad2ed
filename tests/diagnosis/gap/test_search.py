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
    after = SimpleNamespace(candidate_found=False, lin=SimpleNamespace(chosen=chosen), colours=colours, left_over=0.0)
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


def test_what_was_made_at_one_optimum_is_not_taken_for_another():
    """An effect that was fitted afresh, and the same one where its refit came to, with fewer candidates beside it."""

    def path(z):
        lin = SimpleNamespace(chosen=(SimpleNamespace(name="one"),), z=np.array(z))
        stage = SimpleNamespace(lin=lin, colours=SimpleNamespace(best={0: (1.0, 0.0, 1.0)}))
        return searching.Search([stage], base=None, plain=None).path

    assert path([0.5, 1.0]) == path([0.5, 1.0])
    assert path([0.5, 1.0]) != path([0.5, 1.1])


@pytest.mark.parametrize(
    ("left", "worth", "named", "weighed"),
    [(99.0, 60.0, "near", ["near"]), (101.0, 60.0, "far", ["far", "near"]), (101.0, 40.0, "near", ["near", "far"])],
)
def test_where_a_gross_gap_is_left_candidates_are_looked_at_again(monkeypatch, left, worth, named, weighed):
    """And one that is fitted from where the fit began is chosen where it is the more plausible one."""

    def refit(name, evidence):
        lin = SimpleNamespace(amplitudes=[1.0], chosen=(SimpleNamespace(name=name),))
        return SimpleNamespace(names=(name,), evidence=evidence, lin=lin)

    colours = SimpleNamespace(best={})
    before = SimpleNamespace(
        candidate_found=True,
        misfits=True,
        discrepancy=True,
        lin=SimpleNamespace(chosen=(), simulations=0, failed=()),
        grams=SimpleNamespace(evidence=lambda colours: 10.0),
        colours=colours,
    )

    def examine(lin, *_, **__):
        if lin is before.lin:
            return before
        return SimpleNamespace(candidate_found=False, lin=lin, colours=colours, left_over=left)

    begun = SimpleNamespace(lin=SimpleNamespace(problem=None), simulations=0, evidence=0.0)
    monkeypatch.setattr(searching, "settled_base", lambda *_: begun)
    monkeypatch.setattr(searching, "applicable", lambda *_: ((), {}))
    monkeypatch.setattr(searching, "among", lambda *_: before.lin)
    monkeypatch.setattr(searching, "examine", examine)
    monkeypatch.setattr(searching, "refitted", lambda *_: [refit("near", 50.0), refit("other", 45.0)])
    monkeypatch.setattr(searching, "contended", lambda refits, *_: (refits, refits[0]))
    monkeypatch.setattr(searching, "renewed_among", lambda best, *_: best.lin)
    monkeypatch.setattr(searching, "fitted_abroad", lambda *_: ([refit("far", worth)], ["all"]))
    found = search(
        SimpleNamespace(converged=True, problem=None), (), np.ones((1, 2), dtype=bool), np.ones(1), tell=lambda _: None
    )
    assert [one.name for one in found.chosen] == [named]
    # what was not simulated anew is no measure beside what was
    assert [one.names[0] for one in found.refits[0]] == (weighed if left > 100 else ["near", "other"])
    assert (found.tried[0] == ["all"]) == (left > 100)


@pytest.mark.parametrize(
    ("misfits", "discrepancy", "gain", "named"),
    [
        (True, False, 8.5, "far"),
        (False, True, 8.5, "far"),
        (True, True, 7.5, None),  # twins say nothing of it: only what is plain by itself is chosen
        (False, False, 99.0, None),  # no gap, no search
    ],
)
def test_where_no_candidate_stands_out_of_a_gap_they_are_looked_at_from_where_the_fit_began(
    monkeypatch, misfits, discrepancy, gain, named
):
    colours = SimpleNamespace(best={})
    before = SimpleNamespace(
        candidate_found=False,
        misfits=misfits,
        discrepancy=discrepancy,
        lin=SimpleNamespace(chosen=(), simulations=0, failed=()),
        grams=SimpleNamespace(evidence=lambda colours: 10.0),
        colours=colours,
        episodic=False,
    )
    chosen = (SimpleNamespace(name="far"),)
    after = SimpleNamespace(candidate_found=False, lin=SimpleNamespace(chosen=chosen), colours=colours, left_over=500.0)
    far = SimpleNamespace(names=("far",), evidence=10.0 + gain, lin=SimpleNamespace(chosen=chosen))
    begun = SimpleNamespace(lin=SimpleNamespace(problem=None), simulations=0, evidence=0.0)
    looked = []
    monkeypatch.setattr(searching, "settled_base", lambda *_: begun)
    monkeypatch.setattr(searching, "applicable", lambda *_: ((), {}))
    monkeypatch.setattr(searching, "among", lambda *_: before.lin)
    monkeypatch.setattr(searching, "examine", lambda lin, *_, **__: before if lin is before.lin else after)
    monkeypatch.setattr(searching, "renewed_among", lambda *_: None)
    monkeypatch.setattr(searching, "fitted_abroad", lambda *_: looked.append(1) or ([far], []))
    readings = np.ones((1, 2), dtype=bool)
    found = search(SimpleNamespace(converged=True, problem=None), (), readings, np.ones(1), tell=lambda _: None)
    assert [one.name for one in found.chosen] == ([named] if named else [])
    assert len(looked) == (misfits or discrepancy)
