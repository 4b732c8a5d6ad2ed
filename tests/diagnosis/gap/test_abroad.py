"""All candidates looked at from where a fit began: against a cause that is far larger than its scale."""

import numpy as np
import pytest

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.effects import library
from diagnosis.effects.base import Nothing
from diagnosis.fitting.problem import Problem
from diagnosis.gap.abroad import CONTENDING, FITTED, Abroad, abroad, signatures
from diagnosis.gap.linear import applicable, linearised
from diagnosis.recording import HOUR, read_recording
from tests.diagnosis.gap.room_cases import noisy, room

CASES = {"heater.derated": ("effect.heater.derate", 3), "infiltration.constant": ("effect.infiltration.m0", 11)}
"""The FMU's variable, and a seed of weather in which it matters."""


@pytest.fixture(scope="module", params=CASES)
def looked_at(request, tmp_path_factory):
    """A candidate of the default system, its amplitude [scales], and what is seen from the true parameters."""
    name, system = request.param, room().with_experiment(hours=96.0)
    effect = next(one for one in library(system) if one.name == name)
    variable, seed = CASES[name]
    size = 0.8 * min(effect.upper, 5 * effect.scale)
    truth = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
    path = tmp_path_factory.mktemp("abroad") / "room.nc"
    simulate(system, parameters=truth | {variable: size}, hours=96.0, seed=seed, out=path)
    record = noisy(read_recording(path, system), system, 5)
    problem = Problem(Simulator(system), record, occupancy="measured", warm_up=48 * HOUR)
    some = [
        one
        for one in library(system)
        if one.name in {*CASES, "bridge", "plug", "clock", "sensor.CO2.lag", "thermostat.bias"}
    ]
    usable, _ = applicable(problem, some)
    colours = {k: (float(sd), 0.0, HOUR) for k, sd in enumerate(problem.floor)}
    z = problem.unknowns(truth)
    return name, size / effect.scale, problem, usable, abroad(problem, z, usable, problem.observed, colours)


def test_a_cause_of_many_scales_is_seen_with_its_amplitude(looked_at):
    name, size, _, usable, found = looked_at
    assert found.effects[0].name == name
    assert found.amplitudes[0] == pytest.approx(size, rel=0.1)
    assert len(found.effects) == len(usable) and list(found.evidence) == sorted(found.evidence, reverse=True)
    for one, amplitude in zip(found.effects, found.amplitudes, strict=True):
        assert one.lower <= amplitude * one.scale <= one.upper


def test_signatures_are_what_simulations_with_one_effect_differ_by(looked_at):
    name, size, problem, usable, _ = looked_at
    plain = problem.with_effects(())
    z = np.zeros(plain.size)
    lin = linearised(plain, z, plain.linearise(z))
    k = next(k for k, one in enumerate(usable) if one.name == name)
    amplitudes = np.zeros(len(usable))
    amplitudes[k] = size
    made, works = signatures(plain.with_effects(usable), lin, amplitudes)
    alone = plain.with_effects([usable[k]])
    at = np.insert(z, len(plain.system.parameters), size)
    np.testing.assert_allclose(made[..., k], alone.simulate(at, lin.around.heights) - lin.outputs, atol=1e-9)
    assert works.all() and not made[..., np.arange(len(usable)) != k].any()


def test_few_are_fitted_and_none_that_is_far_behind():
    effects = tuple(Nothing(name) for name in "abcdef")
    evidence = (-5.0, -6.0, -7.0, -8.0, -5.0 - 1.1 * CONTENDING, -1e4)
    begins = tuple(np.full(2, k) for k in range(6))
    found = Abroad(effects, tuple(range(6)), begins, evidence, 0)
    assert [one.name for one, *_ in found.foremost("abcdef")] == ["a", "b", "c"][:FITTED]
    assert [(one.name, a, z[0]) for one, a, z in found.foremost("adef")] == [("a", 0, 0), ("d", 3, 3)]
    assert [one.name for one, *_ in found.foremost("ef")] == ["e"]
    assert found.foremost(()) == []
    assert [(one.names, one.evidence) for one in found.ranked[:2]] == [(("a",), -5.0), (("b",), -6.0)]


def test_of_no_candidates_none_is_foremost(looked_at):
    problem = looked_at[2]
    colours = {k: (float(sd), 0.0, HOUR) for k, sd in enumerate(problem.floor)}
    found = abroad(problem, np.zeros(problem.with_effects(()).size), [], problem.observed, colours)
    assert found.foremost(()) == [] and found.ranked == []
