"""Fits against what can be computed otherwise: a grid over the posterior, and an exact recursion of a house."""

import numpy as np
import pytest
from scipy.stats import norm

from datagen.driving.occupancy import sample_occupancy
from datagen.simulating.simulator import Simulator
from diagnosis.effects.base import Nothing
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.runs import Unknowns
from diagnosis.recording import HOUR, read_recording
from shared.errors import SimulationError
from tests.diagnosis.conftest import TRUTH, WARM_UP


@pytest.fixture
def problem_of(house, house_recording):
    """``problem_of(hours, ...)``: of a house whose recording another program made; ``change`` comes to its readings."""

    def made(hours, kind="me", *, system=None, change=None, sd=None, occupancy=None, **recording):
        noise = {} if sd is None else {"noise": sd}
        record = read_recording(house_recording(hours=hours, **noise, **recording), house(kind))
        record.outputs[0] += 0.0 if change is None else change(record.time)
        options = {"known": ["history"], "warm_up": WARM_UP * HOUR, "occupancy": occupancy}
        options["noise"] = "sensor" if sd is None else np.array([sd])
        return Problem(Simulator(system or house(kind)), record, **options)

    return made


@pytest.mark.parametrize(("kind", "hours", "least"), [("me", 240, 0.2), ("cs", 72, 0.05)])
def test_a_house_is_recovered(problem_of, kind, hours, least):
    """The recording is made by another program, the exact recursion; both kinds of FMU find its parameters."""
    found = fit(problem_of(hours, kind))
    assert found.converged
    error = (found.z - found.problem.unknowns(TRUTH)) / found.sd
    assert np.abs(error).max() < 3.5
    assert found.sd.max() < 0.2
    assert found.at_bound == ()
    # less than 1: the heater is a mean over hours to the fit, which cannot know that it was constant within them
    assert least < np.mean(found.residual**2) < 1.3


def knowing(system, *names):
    """The system with the true values of some of its parameters."""
    free = [one for one in system.parameters if one.name not in names]
    return system.model_copy(
        update={"parameters": free, "fixed": {**system.fixed, **{name: TRUTH[name] for name in names}}}
    )


def test_the_posterior_is_that_of_a_grid(house, problem_of):
    """One unknown is free; its posterior is summed over a grid, without any linearisation."""
    alone = knowing(house("me"), "ro", "ri", "c")
    problem = problem_of(48, system=alone, sd=0.3)
    problem = problem.with_nuisance(problem.nuisance.only(np.zeros(problem.nuisance.size, dtype=bool)))
    found = fit(problem)
    grid = np.linspace(-3, 3, 301)
    loss = np.array([np.sum(problem.residuals(np.array([z])) ** 2) for z in grid])
    weight = np.exp(-0.5 * (loss - loss.min())) * norm.pdf(grid)
    weight /= weight.sum()
    mean = float(weight @ grid)
    assert found.z[0] == pytest.approx(mean, abs=0.1 * found.sd[0])
    assert found.sd[0] == pytest.approx(float(np.sqrt(weight @ (grid - mean) ** 2)), rel=0.1)
    log_evidence = np.log(np.sum(np.exp(-0.5 * (loss - loss.min())) * norm.pdf(grid)) * (grid[1] - grid[0]))
    log_evidence -= 0.5 * loss.min() + 48 * np.log(0.3 * np.sqrt(2 * np.pi))
    assert found.log_evidence == pytest.approx(log_evidence, abs=0.05)


class Bias(Nothing):
    """A sensor that shows too much, always."""

    def outputs(self, amplitude, outputs, time):
        return outputs + amplitude


class Jump(Nothing):
    """A sensor that shows too much from the middle of the recording on."""

    def outputs(self, amplitude, outputs, time):
        return outputs + amplitude * (time > time.mean())


def test_an_effect_joins_the_unknowns(problem_of):
    """A bias of 0.4 K that comes with the second half is found together with the parameters, as large as it is."""
    problem = problem_of(72, change=lambda time: 0.4 * (time > time.mean()))
    problem = problem.with_effects([Jump("bias", "degC", scale=0.5)])
    assert problem.names[-1] == "bias"
    found = fit(problem)
    assert abs(problem.values(found.z)[-1] - 0.4) < 3.5 * 0.5 * found.sd[-1]
    without = fit(problem.with_effects([]))
    assert found.log_evidence > without.log_evidence + 3
    assert problem.with_effects([]).names == list(TRUTH)


def test_a_bias_that_the_insulation_imitates_is_not_claimed(house, problem_of):
    """A constant bias is a little less insulation: the posterior says so, and tells it where insulation is known."""
    bias = Bias("bias", "degC", scale=0.5)
    found, sure = (
        fit(problem_of(120, system=system, change=lambda time: 0.4).with_effects([bias]))
        for system in (house("me"), knowing(house("me"), "ro"))
    )
    assert abs(found.covariance[-1, 0]) > 0.97 * found.sd[-1] * found.sd[0]
    assert found.sd[-1] > 0.4
    assert abs(found.z[-1] - 0.4 / 0.5) < 3 * found.sd[-1]
    assert sure.sd[-1] < 0.2
    assert abs(sure.z[-1] - 0.4 / 0.5) < 3.5 * sure.sd[-1]


def test_held_out_readings_do_not_count(problem_of):
    problem = problem_of(48)
    half = np.zeros(problem.observed.shape, dtype=bool)
    half[:, :24] = True
    damaged = problem.with_measured(np.where(half, problem.measured, 1e6)).with_observed(half)
    whole = problem.with_observed(half)
    z = problem.unknowns(TRUTH)
    np.testing.assert_array_equal(damaged.residuals(z), whole.residuals(z))
    assert len(whole.residuals(z)) == 24


def test_bounds_are_flagged(problem_of):
    """A house with four times the glass that the range allows."""
    assert "a" in fit(problem_of(48, values={"a": 20.0})).at_bound


@pytest.mark.slow
def test_errors_are_as_large_as_the_posterior_says(house, house_recording):
    """Eight houses whose persons nobody counted: standardised errors are neither too large nor too small."""
    system = house("me")
    simulator = Simulator(system)
    errors = []
    for seed in range(8):
        rng = np.random.default_rng(100 + seed)
        z = 0.7 * rng.standard_normal(4)
        values = dict(zip(TRUTH, Unknowns(system, (), (), ()).values(z), strict=True))
        persons = sample_occupancy(system.occupancy, rng, -WARM_UP * HOUR, 48 * HOUR)
        half_hours = -WARM_UP * HOUR + 1800 * np.arange(192)
        crowd = np.mean([persons.at(half_hours + 60 * k) for k in range(30)], axis=0)
        record = read_recording(house_recording(48, seed=seed, persons=crowd, values=values, count=False), system)
        found = fit(Problem(simulator, record, warm_up=WARM_UP * HOUR))
        errors.append((found.z[:4] - z) / found.sd[:4])
    errors = np.array(errors)
    assert 0.6 < np.sqrt(np.mean(errors**2)) < 1.5
    assert np.mean(np.abs(errors) < 1.645) > 0.7


@pytest.mark.parametrize("first", [0, 1])
def test_a_start_that_cannot_be_simulated_is_left_for_another(problem_of, monkeypatch, first):
    """Its derivatives cannot either: what a solver asks for before its first step."""
    problem = problem_of(48)
    place = problem.names.index("c")
    bad = problem.unknowns(TRUTH)
    bad[place] += 2.0
    whole = Problem.simulate_each

    def failing(self, cases, *rest, **named):
        made = whole(self, cases, *rest, **named)
        return [
            SimulationError("the FMU fails here") if z[place] > bad[place] - 0.5 else one
            for (z, _), one in zip(cases, made, strict=True)
        ]

    monkeypatch.setattr(Problem, "simulate_each", failing)
    starts = [("truth", problem.unknowns(TRUTH))]
    starts.insert(first, ("bad", bad))
    found = fit(problem, starts)
    assert found.started_from == "truth"
    assert np.abs((found.z - found.problem.unknowns(TRUTH)) / found.sd).max() < 3.5
    with pytest.raises(SimulationError):
        fit(problem, [("bad", bad)] * 2)
