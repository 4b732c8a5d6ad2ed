"""Derivatives that go along with the steps of a refit; its spread and its misfit, written out densely."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.effects import library
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import AMPLITUDE, Grams, estimated_colours
from diagnosis.gap.linear import Linearised, applicable, linearised
from diagnosis.gap.refit import from_one_start, line_at, misfit, on_the_best_line, refit, relinearised
from diagnosis.gap.shrinkage import kept_for_scoring
from diagnosis.recording import HOUR, read_recording
from tests.diagnosis.gap.room_cases import in_the_middle, noisy, room
from tests.diagnosis.gap.test_linear import covariance_of, problem_of

pytestmark = pytest.mark.slow


def test_persons_of_the_days_kept_from_a_fit_are_told_by_those_days(default_system, tmp_path):
    system = in_the_middle(default_system, tmp_path / "room.nc", hours=120.0)
    record = read_recording(tmp_path / "room.nc", system)
    whole = Problem(Simulator(system), record, occupancy="unknown", known=["constants"])
    scored = kept_for_scoring(record)
    fitted = whole.observed & ~scored
    base = fit(whole.with_observed(fitted), rounds=1)  # from the truth, the middle of the prior
    carbon = system.output_names.index("CO2")
    rows = scored & whole.observed[carbon]
    grams = Grams(linearised(base.problem, base.z, base.around), fitted)

    def left(every):
        there = relinearised(grams, estimated_colours(grams, whole.floor).best, base.z, every)
        return np.sqrt(np.mean((whole.measured - there.outputs)[carbon][rows] ** 2))

    # the usual persons of such a day miss the day that was; told by it, little but the sensor's own error is left
    assert left(whole.observed) < 0.4 * left(fitted)


MIXED = {0: (1.0, 0.5, 5 * HOUR), 1: (0.7, 0.0, HOUR)}
SHORT = {"warm_up": 24 * HOUR, "known": ["constants"]}
"""The fewer unknowns and hours, the shorter the simulations."""


def straight(seed=4):
    """A problem that is linear throughout, with one chosen effect, and its products; all readings observed."""
    toy = problem_of(np.random.default_rng(seed), chosen=1)
    bounds = (np.full(len(toy.z), -9.0), np.full(len(toy.z), 9.0))
    problem = SimpleNamespace(**vars(toy.problem), effects=toy.chosen, bounds=bounds)
    problem.with_effects = lambda effects: problem
    lin = Linearised(
        problem=problem,
        around=None,
        z=toy.z,
        residual=np.random.default_rng(seed + 1).standard_normal(toy.residual.shape),
        outputs=toy.residual,
        by_nuisance=toy.by_nuisance,
        turn=np.eye(toy.by_nuisance.shape[2]),
        by_unknown=toy.by_unknown,
        by_effect=toy.by_effect,
        effects=toy.effects,
        failed={},
    )
    return lin, Grams(lin, np.ones(lin.residual.shape, dtype=bool))


def weight_of(lin):
    """Inverse covariance of all readings, channel after channel, with the nuisance in it."""
    n = len(lin.problem.time)
    noise = np.zeros((2 * n, 2 * n))
    for k, colour in MIXED.items():
        noise[k * n : (k + 1) * n, k * n : (k + 1) * n] = covariance_of(colour, lin.problem.time)
    nuisance = np.concatenate(lin.by_nuisance)
    return np.linalg.inv(noise + nuisance @ nuisance.T)


def test_the_spread_of_the_unknowns_is_that_of_the_dense_posterior():
    """Two parameters with a prior of one, and an amplitude with one of AMPLITUDE [scales]."""
    lin, grams = straight()
    columns = np.concatenate(lin.by_unknown)
    prior = np.diag(1 / np.array([1.0, 1.0, AMPLITUDE]) ** 2)
    expected = np.sqrt(np.diag(np.linalg.inv(prior + columns.T @ weight_of(lin) @ columns)))
    np.testing.assert_allclose(refit(grams, MIXED, lin.z, (), steps=0).sd, expected, rtol=1e-8)


def test_the_misfit_is_half_the_squares_of_residual_and_of_unknowns_in_their_spreads():
    lin, grams = straight()
    left = np.concatenate(lin.residual)
    expected = left @ weight_of(lin) @ left + lin.z[0] ** 2 + lin.z[1] ** 2 + (lin.z[2] / AMPLITUDE) ** 2
    assert abs(lin.z[2]) > 0.1
    assert misfit(grams, MIXED) == pytest.approx(0.5 * expected, rel=1e-9)


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
