"""A clock that is an hour late, in a recording whose actuators are replayed."""

import numpy as np
import pytest
import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.effects import library
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.gap.afresh import bent, fitted_afresh
from diagnosis.gap.colours import estimated_colours
from diagnosis.gap.grams import Grams
from diagnosis.gap.refit import linear_start, refit
from diagnosis.gap.renewal import settled
from diagnosis.gap.search import among, settled_base
from diagnosis.recording import HOUR, read_recording
from tests.diagnosis.gap.room_cases import in_the_middle

pytestmark = pytest.mark.slow


def test_a_late_clock_is_found_from_the_middle_of_the_prior(default_system, tmp_path):
    system = in_the_middle(default_system, tmp_path / "room.nc", hours=97.0)
    data = xr.load_dataset(tmp_path / "room.nc", decode_times=False)
    late = data.isel(time=slice(None, -1)).copy(deep=True)  # a reading of eleven is written down at ten
    for name in system.output_names:
        late[name].values[:] = data[name].values[1:]
    late.to_netcdf(tmp_path / "late.nc")
    record = read_recording(tmp_path / "late.nc", system)
    whole = Problem(Simulator(system), record, occupancy="measured", replay=True, warm_up=48 * HOUR)
    base = fit(whole.with_effects(()), rounds=2)
    clock = next(one for one in library(system) if one.name == "clock")
    bare = settled_base(base, whole.observed)
    grams = Grams(among(bare, [clock]), whole.observed)
    colours = estimated_colours(grams, whole.floor).best
    there = refit(grams, colours, linear_start(grams, colours, [0]), [clock])
    straight = settled(
        there.lin.problem, there.lin.z, there.lin.around, whole.observed, whole.floor, colours, renewals=1
    )
    found = fitted_afresh(base.problem, there, whole.observed, colours)
    # from the base model's fit, which had bent itself to make up for the hour, the way ends at half of it
    assert bent(there, straight)
    assert straight.lin.amplitudes[0] * clock.scale < 0.7
    np.testing.assert_allclose(found.lin.amplitudes[0] * clock.scale, 1.0, atol=0.1)
    assert found.evidence > straight.evidence
