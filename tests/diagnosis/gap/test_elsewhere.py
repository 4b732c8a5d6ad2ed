"""Effects whose best size lies in another trough than where the steps of a refit end."""

import numpy as np
import pytest
import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.effects import build
from diagnosis.effects.base import Nothing
from diagnosis.fitting.problem import Problem
from diagnosis.gap.elsewhere import FAR, GRID, elsewhere, grid
from diagnosis.gap.grams import Grams
from diagnosis.gap.linear import linearised
from diagnosis.gap.refit import misfit, refit
from diagnosis.gap.search import at_its_optimum, search
from diagnosis.gap.starting import begun
from diagnosis.recording import read_recording
from shared.effects import InputEffect
from tests.diagnosis.conftest import HOUR

LATE = 5.0
"""Hours by which the recorded heater is ahead of the real one."""


def late_heater(system):
    """The heater is late against its record."""
    return build(
        InputEffect(
            name="late",
            kind="input",
            unit="h",
            input="P",
            operation="shift",
            factor=HOUR,
            scale=1.0,
            lower=-8.0,
            upper=8.0,
        ),
        system,
    )


@pytest.fixture(scope="module")
def ahead(house_recorded, tmp_path_factory):
    """A recording whose heater is written down too early."""
    path = house_recorded(tmp_path_factory.mktemp("ahead"), hours=336, seed=3)
    data = xr.load_dataset(path, decode_times=False)
    data["P"].values[:] = np.roll(data["P"].values, -int(LATE))
    path.unlink()
    data.to_netcdf(path)
    return path


@pytest.mark.slow
def test_another_trough_is_found_if_it_is_deeper(house, ahead):
    """Readings at the ends of hours hardly tell shifts within one hour apart, so that five may be nearly six."""
    system = house("me")
    record = read_recording(ahead, system)
    whole = Problem(Simulator(system.with_experiment(hours=336.0)), record)
    first = begun(whole, None)
    made = search(first.fit, [late_heater(system)], whole.observed, begin=first.start)
    made = at_its_optimum(made)
    (there,), colours = made.settled, made.last.colours.best
    place = len(system.parameters)
    assert LATE - 0.1 < there.lin.z[place] < LATE + 1.0

    def from_(hours):
        z = np.where(np.arange(len(there.lin.z)) == place, hours, there.lin.z)
        begun = linearised(there.lin.problem, z, there.lin.around, (), None, there.lin)
        return refit(Grams(begun, there.grams.observed, there.grams), colours, z, ())

    stuck = from_(-2.0)
    assert misfit(stuck.grams, colours) > misfit(there.grams, colours) + 1000.0  # steps alone do not lead there
    found = elsewhere(stuck, colours)
    assert LATE - 0.1 < found.lin.z[place] < LATE + 1.0
    assert misfit(found.grams, colours) < misfit(there.grams, colours) + 10.0
    assert found.simulations > stuck.simulations
    assert elsewhere(found, colours).lin is found.lin


@pytest.mark.parametrize(
    ("lower", "upper", "ends"),
    [(-1.0, 3.0, (-0.5, 1.5)), (-np.inf, np.inf, (-FAR, FAR)), (0.0, np.inf, (0.0, FAR)), (-99.0, 4.0, (-FAR, 2.0))],
)
def test_amplitudes_are_from_all_over_the_range_which_may_be_endless(lower, upper, ends):
    found = grid(Nothing("some", lower=lower, upper=upper, scale=2.0))
    assert (found[0], found[-1]) == pytest.approx(ends)
    np.testing.assert_allclose(np.diff(found), (ends[1] - ends[0]) / (GRID - 1))
