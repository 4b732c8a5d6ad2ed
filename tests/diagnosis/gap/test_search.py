"""What the search begins from, a fit whose nuisance follows the readings kept from it; and what ends it at once."""

from types import SimpleNamespace

import numpy as np
import pytest

from datagen import simulate
from datagen.simulator import Simulator
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.unknowns import Unknowns
from diagnosis.gap import search as searching
from diagnosis.gap.parts import kept_for_scoring
from diagnosis.gap.search import everywhere, search
from diagnosis.recording import HOUR, read_recording


@pytest.fixture(scope="module")
def recorded(default_system, tmp_path_factory):
    path = tmp_path_factory.mktemp("search") / "room.nc"
    system = default_system.with_experiment(step=HOUR, hours=120.0)
    middle = Unknowns(system, (), ()).values(np.zeros(len(system.parameters)))
    truth = dict(zip((one.name for one in system.parameters), middle, strict=True))
    simulate(system, parameters=truth, hours=120.0, seed=8, out=path)
    return Simulator(system), read_recording(path, system)


def fitted(simulator, record, occupancy):
    """One round from the truth, the middle of the prior, on the part that is fitted."""
    whole = Problem(simulator, record, occupancy=occupancy)
    scored = kept_for_scoring(record)
    return whole, scored, fit(whole.with_observed(whole.observed & ~scored), rounds=1)


def test_persons_of_the_days_kept_for_scoring_are_told_by_those_days(recorded):
    whole, scored, base = fitted(*recorded, "unknown")
    assert scored.any()
    followed, simulations = everywhere(base, whole.observed)
    assert simulations > 0
    np.testing.assert_array_equal(followed.z, base.z)
    carbon = whole.system.output_names.index("CO2")
    rows = scored & whole.observed[carbon]

    def left(one):
        return np.sqrt(np.mean((whole.measured - one.around.outputs)[carbon][rows] ** 2))

    # the usual persons of such a day miss the day that was; afterwards little but the sensor's own error is left
    assert left(followed) < 0.4 * left(base)
    # what is fitted is weighed as before
    assert len(followed.around.marginal.by_unknown) == base.problem.observed.sum()


def test_persons_who_were_counted_need_no_following(recorded):
    whole, _, base = fitted(*recorded, "measured")
    assert everywhere(base, whole.observed) == (base, 0)


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
