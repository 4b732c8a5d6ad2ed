"""Effects see what drives the model: persons whom nobody counted act as those do who were counted."""

import json

import numpy as np
import pytest

from datagen import simulate
from datagen.simulating.constants import constants
from datagen.simulating.simulator import Simulator
from diagnosis.blind.truth import default_truth, load_truth
from diagnosis.effects import library
from diagnosis.effects.base import Nothing
from diagnosis.fitting.lines import linearised
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.runs import Unknowns
from diagnosis.recording import read_recording
from shared.errors import SystemDescriptionError
from shared.system import load_system, system_from_canonical
from tests.diagnosis.fitting.crowd_cases import HALF_HOUR, as_counted, on_persons


@pytest.fixture(scope="module")
def room():
    return load_system("fmus/MixedAirCO2").with_experiment(hours=168.0, start=(4300.0, 4300.0))


@pytest.fixture(scope="module")
def simulator(room):
    return Simulator(room)


def test_constants_are_multiplied_between_effects_and_levels(room, simulator):
    known = constants(room, simulator.fmu)
    unknown = Unknowns(room, (Nothing("idle", scale=2.0),), known, ())
    first = len(room.parameters)
    assert unknown.names[first:] == ["idle", *(one.name for one in room.uncertain)]
    z = np.zeros(unknown.size)
    z[first], z[first + 1] = 1.0, 2.0
    assert unknown.values(z)[first:].tolist() == [2.0, pytest.approx(np.exp(0.6)), 1, 1, 1, 1, 1, 1]
    given = unknown.parameters(z)
    # floor.layer[1].C of the FMU is 18829.8 J/(m2.K)
    assert given["floor.layer[1].C"] == pytest.approx(18829.8 * np.exp(0.6))
    assert given["floor.layer[1].R"] == pytest.approx(0.126667)
    factors = {"idle": 2.0} | dict(zip([one.name for one in known], unknown.values(z)[first + 1 :], strict=True))
    np.testing.assert_allclose(unknown.of(factors), z, atol=1e-12)
    assert all(low == -high for low, high in zip(*unknown.bounds, strict=True) if np.isfinite(high))


def test_what_cannot_be_multiplied_is_told(room):
    for wrong, says in (("floor.layer[3].C", "with value 0"), ("TRoo", "is a output"), ("nothing", "not a variable")):
        raw = json.loads(room.canonical())
        raw["uncertain"] = [{"name": "u", "parameters": [wrong], "relative": 0.1}]
        with pytest.raises(SystemDescriptionError, match=says):
            Simulator(system_from_canonical(json.dumps(raw), room.path))


@pytest.mark.slow
def test_finer_walls_do_not_bend_the_parameters(room, simulator, tmp_path):
    """With held constants, what coarse walls do wrong is taken for solar gain and U-value."""
    path = tmp_path / "room.nc"
    data = simulate(room, seed=4000, index=5, out=path)
    record = read_recording(path, room)
    walls = load_truth(default_truth(room), room).described(room).with_experiment(step=record.step, hours=168.0)
    truth = Problem(Simulator(walls), record, occupancy="measured", known=["constants"])
    values = {name: float(data[name]) for name in room.parameter_names}
    finer = truth.simulate(truth.unknowns(values))
    off = {}
    for uncertain, known in ((False, ["constants"]), (True, [])):
        problem = Problem(simulator, record, occupancy="measured", known=known)
        z = problem.unknowns(values)
        gap = problem.with_measured(np.where(problem.observed, finer, np.nan))
        left, jacobian = gap.residuals(z), gap.standardised(linearised(gap, z, gap.linearise(z)).by_unknown)
        information = np.eye(problem.size) + jacobian.T @ jacobian
        moved = np.linalg.solve(information, jacobian.T @ left)  # of the parameters, in prior standard deviations
        off[uncertain] = (moved / np.sqrt(np.diag(np.linalg.inv(information))))[: len(room.parameters)]
    assert np.abs(off[False]).max() > 2.0
    assert np.abs(off[True]).max() < 1.0


FORGOTTEN = 48 * 3600.0
"""After so long the room has forgotten who was there before the recording, to two per cent of any effect [s]."""
MOVED = np.array([0.05, 2.0])
"""What any of the effects moves at least, root mean square [K, ppm]: far above the integrator's error."""


def effects(system):
    """Effects that follow persons, or change them, or neither."""
    named = {one.name: one for one in library(system)}
    presence = {"form": "presence", "series": "nPer", "half": 2.0}
    return {
        "window.warm": named["window.warm"],
        "shift": on_persons(system, "shift", HALF_HOUR),
        "add": on_persons(system, "add", 5.0, [presence]),
    }


def moved(problem, effect, z, heights):
    """What two scales of an effect move, shape (outputs, steps) [unit of each]."""
    place = len(problem.system.parameters)
    other = problem.with_effects([effect])
    return other.simulate(np.insert(z, place, 2.0), heights) - problem.simulate(z, heights)


@pytest.mark.parametrize("name", ["window.warm", "shift", "add"])
def test_who_was_not_counted_acts_as_if_counted(warm, name):
    simulator, recording = warm
    effect = effects(simulator.system)[name]
    known = Problem(simulator, recording, occupancy="measured", known=["constants"], warm_up=HALF_HOUR)
    unknown = Problem(simulator, recording, occupancy="unknown", known=["constants"], warm_up=HALF_HOUR)
    late = recording.time > recording.start + FORGOTTEN
    wanted = moved(known, effect, np.zeros(known.size), known.nuisance.mean)[:2, late]
    found = moved(unknown, effect, *as_counted(unknown, recording, 7.0))[:2, late]
    assert (np.sqrt((wanted**2).mean(axis=1)) > MOVED).all()
    assert (np.abs(found - wanted).max(axis=1) < 0.02 * np.abs(wanted).max(axis=1)).all()


def test_pulses_of_persons_answer_with_the_effect_that_follows_them(warm):
    """At an amplitude that is not zero, what one more person does is what both runs with the window say."""
    simulator, recording = warm
    effect = effects(simulator.system)["window.warm"]
    problem = Problem(simulator, recording, occupancy="unknown", known=["constants"], warm_up=HALF_HOUR)
    problem = problem.with_effects([effect])
    z, heights = as_counted(problem.with_effects([]), recording, 7.0)
    z = np.insert(z, len(problem.system.parameters), 2.0)
    problem = problem.with_nuisance(problem.nuisance.only(problem.nuisance.begin < recording.start + 86400.0))
    heights = heights[: problem.nuisance.size]
    standard = np.linalg.lstsq(problem.nuisance.factor, heights - problem.nuisance.mean, rcond=None)[0]
    around = problem.linearise(z, standard)
    k = int(np.argmax(around.heights))
    one = 0.5 * problem.nuisance.sd[k] * (np.arange(len(heights)) == k)
    alone = problem.simulate(z, around.heights + one) - around.outputs
    rows = problem.time <= problem.nuisance.begin[k] + 86400.0
    said = around.response[..., k] * one[k]
    np.testing.assert_allclose(said[:2, rows], alone[:2, rows], atol=0.02 * np.abs(alone[1]).max())
