"""Base model and candidates from one start: against causes that are far from any straight line."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.effects import build, library
from diagnosis.effects.base import Nothing
from diagnosis.fitting.problem import Problem
from diagnosis.gap.linear import Linearised, applicable
from diagnosis.gap.rivals import GRID, begun, from_one_start, line_at, on_the_best_line
from diagnosis.recording import HOUR, read_recording
from shared.effects import InputEffect
from shared.errors import SimulationError
from tests.diagnosis.gap.room_cases import in_the_middle, noisy, room

LATE = 5.0
"""Hours by which the recorded heater is ahead of the real one."""


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
    system = room().with_experiment(hours=96.0)
    some = {"heater.derated", "infiltration.constant", "bridge", "plug", "thermostat.bias"}
    effects = [one for one in library(system) if one.name in some]
    (cause,) = [one for one in effects if one.name == "heater.derated"]
    size = 0.8 * min(cause.upper, 5 * cause.scale)
    truth = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
    simulate(system, parameters=truth | {"effect.heater.derate": size}, hours=96.0, seed=3, out=tmp_path / "room.nc")
    record = noisy(read_recording(tmp_path / "room.nc", system), system, 5)
    problem = Problem(Simulator(system), record, occupancy="measured", warm_up=48 * HOUR)
    for rivals in compared(problem, effects):
        assert rivals.refits[0].names == ("heater.derated",)
        assert amplitude(rivals, "heater.derated") == pytest.approx(size, rel=0.1)
        assert len(rivals.refits) == len(some) and not rivals.failed
        assert rivals.refits[0].evidence > rivals.base.evidence + 10.0


@pytest.mark.slow
def test_a_clock_that_is_an_hour_late_is_found_in_replay(default_system, tmp_path):
    """From the base model's fit, which bends itself to make up for the hour, the way ends at half of it."""
    system = in_the_middle(default_system, tmp_path / "room.nc", hours=97.0)
    data = xr.load_dataset(tmp_path / "room.nc", decode_times=False)
    late = data.isel(time=slice(None, -1)).copy(deep=True)  # a reading of eleven is written down at ten
    for name in system.output_names:
        late[name].values[:] = data[name].values[1:]
    late.to_netcdf(tmp_path / "late.nc")
    record = read_recording(tmp_path / "late.nc", system)
    problem = Problem(Simulator(system), record, occupancy="measured", replay=True, warm_up=48 * HOUR)
    first, last = compared(problem, [one for one in library(system) if one.name == "clock"])
    assert amplitude(last, "clock") == pytest.approx(1.0, abs=0.1)
    assert amplitude(first, "clock") == pytest.approx(1.0, abs=0.3)


@pytest.mark.slow
def test_a_shift_of_hours_is_found_though_another_trough_is_nearer(house, house_recorded, tmp_path):
    """Readings at the ends of hours hardly tell shifts within one hour apart, so that five may be nearly six."""
    path = house_recorded(tmp_path, hours=168, seed=3)
    data = xr.load_dataset(path, decode_times=False)
    data["P"].values[:] = np.roll(data["P"].values, -int(LATE))
    path.unlink()
    data.to_netcdf(path)
    common = {"kind": "input", "unit": "h", "input": "P", "operation": "shift", "factor": HOUR}
    spec = InputEffect(name="late", scale=1.0, lower=-8.0, upper=8.0, **common)
    system = house("me")
    problem = Problem(Simulator(system.with_experiment(hours=168.0)), read_recording(path, system))
    _, last = compared(problem, [build(spec, system)])
    assert LATE - 0.1 < amplitude(last, "late") < LATE + 1.0


def test_a_candidate_begins_with_the_amplitude_that_promises_most():
    """Of a signature that is no multiple of itself, within its bounds; one that cannot be simulated has none."""
    rng = np.random.default_rng(4)
    steps, effects = 60, (Nothing("bent"), Nothing("bounded", lower=0.0, upper=1.0), Nothing("stiff"))
    signature = 8.0 * np.linalg.qr(rng.standard_normal((steps, 3)))[0].T

    def outputs(amplitudes):
        if amplitudes[2]:
            return SimulationError("it is stiff")
        bent = signature[0] * (amplitudes[0] == 2.0) + 0.3 * signature[1] * amplitudes[0]
        return (bent + amplitudes[1] * signature[2])[None]

    library = SimpleNamespace(simulate_each=lambda cases: [outputs(z) for z, _ in cases])
    system = SimpleNamespace(parameters=[])
    problem = SimpleNamespace(
        system=system, effects=(), time=HOUR * np.arange(1.0, steps + 1), with_effects=lambda _: library
    )
    truth = outputs(np.array([2.0, 3.0, 0.0]))
    empty = np.zeros((1, steps, 0))
    lin = Linearised(
        problem=problem,
        around=SimpleNamespace(heights=None),
        z=np.zeros(0),
        residual=truth,
        outputs=np.zeros((1, steps)),
        by_nuisance=empty,
        turn=empty,
        by_unknown=empty,
        by_effect=empty,
        effects=(),
        failed={},
    )
    amplitudes, secants, failed = begun(lin, effects, np.ones((1, steps), dtype=bool), {0: (0.1, 0.0, HOUR)})
    assert amplitudes.tolist() == [2.0, 1.0, 0.0] and 2.0 in GRID
    assert failed == {"stiff": "it is stiff"}
    np.testing.assert_allclose(secants[0, :, 1], signature[2])
