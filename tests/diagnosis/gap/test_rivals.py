"""Candidates beside the base model, on recordings whose cause is known."""

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.effects import library
from diagnosis.fitting.lines import applicable
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import line_at
from diagnosis.gap.rivals import from_one_start, on_the_best_line
from diagnosis.recording import HOUR, read_recording
from tests.diagnosis.gap.room_cases import in_the_middle, noisy, room

SHORT = {"warm_up": 24 * HOUR, "known": ["constants"]}
"""The fewer unknowns and hours, the shorter the simulations."""


def compared(problem, effects):
    """Rivals from the middle of the prior, and on the line of the best."""
    usable, _ = applicable(problem, effects)
    colours = {k: (float(sd), 0.0, HOUR) for k, sd in enumerate(problem.floor)}
    start = np.zeros(problem.size)
    first = from_one_start(line_at(problem, start), usable, problem.observed, colours)
    return first, on_the_best_line(first, start, problem.observed, colours)


def amplitude(rivals, name):
    (one,) = [one for one in rivals.refits if one.names == (name,)]
    return float(one.lin.amplitudes[0]) * one.lin.chosen[0].scale


@pytest.mark.slow
def test_a_heater_that_gives_a_fifth_of_its_power_is_the_first_of_both_lines(tmp_path):
    """Its scale is far less, and close to a base model that has bent itself it would change nothing."""
    system = room().with_experiment(hours=72.0)
    some = {"heater.derated", "infiltration.constant", "bridge"}
    effects = [one for one in library(system) if one.name in some]
    (cause,) = [one for one in effects if one.name == "heater.derated"]
    size = 0.8 * min(cause.upper, 5 * cause.scale)
    truth = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
    simulate(system, parameters=truth | {"effect.heater.derate": size}, hours=72.0, seed=3, out=tmp_path / "room.nc")
    record = noisy(read_recording(tmp_path / "room.nc", system), system, 5)
    problem = Problem(Simulator(system), record, occupancy="measured", **SHORT)
    for rivals in compared(problem, effects):
        assert rivals.refits[0].names == ("heater.derated",)
        assert amplitude(rivals, "heater.derated") == pytest.approx(size, rel=0.1)
        assert len(rivals.refits) == len(some) and not rivals.failed
        assert rivals.refits[0].evidence > rivals.base.evidence + 10.0


@pytest.mark.slow
def test_a_clock_that_is_an_hour_late_is_found_in_replay(default_system, tmp_path):
    """From the base model's fit, which bends itself to make up for the hour, the way ends at half of it."""
    system = in_the_middle(default_system, tmp_path / "room.nc", hours=73.0)
    data = xr.load_dataset(tmp_path / "room.nc", decode_times=False)
    late = data.isel(time=slice(None, -1)).copy(deep=True)  # a reading of eleven is written down at ten
    for name in system.output_names:
        late[name].values[:] = data[name].values[1:]
    late.to_netcdf(tmp_path / "late.nc")
    record = read_recording(tmp_path / "late.nc", system)
    problem = Problem(Simulator(system), record, occupancy="measured", replay=True, **SHORT)
    first, last = compared(problem, [one for one in library(system) if one.name == "clock"])
    assert amplitude(last, "clock") == pytest.approx(1.0, abs=0.1)
    assert amplitude(first, "clock") == pytest.approx(1.0, abs=0.3)
