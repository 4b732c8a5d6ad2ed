"""What the search begins from: a fit whose nuisance follows the readings that took no part in it."""

import numpy as np
import pytest

from datagen import simulate
from datagen.simulator import Simulator
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.unknowns import Unknowns
from diagnosis.gap.parts import kept_for_scoring
from diagnosis.gap.search import everywhere
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
