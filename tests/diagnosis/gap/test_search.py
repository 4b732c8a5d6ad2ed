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
    monkeypatch.setattr(searching, "settled_refit", lambda *_: None)
    readings = np.ones((1, 2), dtype=bool)
    found = search(SimpleNamespace(converged=True), (), readings, np.ones(1), tell=lambda _: None)
    assert found.confirmed == confirmed
    assert found.chosen == (chosen if confirmed else ())


@pytest.mark.parametrize("foremost", [None, 2, 7])
def test_what_stands_out_most_from_its_own_twins_is_refitted_however_much_others_gain(monkeypatch, foremost):
    count = 9
    scan = SimpleNamespace(
        order=list(range(count)),
        evidence=np.linspace(40.0, 20.0, count),
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
    near = [f"effect {j}" for j in range(count) if scan.evidence[j] > 32.0][: searching.MOST_REFITS]
    assert tried == near + ([f"effect {foremost}"] if foremost == 7 else [])
