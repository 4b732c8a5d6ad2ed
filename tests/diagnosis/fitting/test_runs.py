"""Effects see what drives the model: persons whom nobody counted act as those do who were counted."""

import numpy as np
import pytest

from diagnosis.effects import library
from diagnosis.fitting.problem import Problem
from tests.diagnosis.fitting.crowd_cases import HALF_HOUR, as_counted, on_persons, warm_room

FORGOTTEN = 48 * 3600.0
"""After so long the room has forgotten who was there before the recording, to two per cent of any effect [s]."""
MOVED = np.array([0.05, 2.0])
"""What any of the effects moves at least, root mean square [K, ppm]: far above the integrator's error."""


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """Simulator and recording."""
    return warm_room(tmp_path_factory.mktemp("warm") / "room.nc")


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
    known = Problem(simulator, recording, occupancy="measured", uncertain=False, warm_up=HALF_HOUR)
    unknown = Problem(simulator, recording, occupancy="unknown", uncertain=False, warm_up=HALF_HOUR)
    late = recording.time > recording.start + FORGOTTEN
    wanted = moved(known, effect, np.zeros(known.size), known.nuisance.mean)[:2, late]
    found = moved(unknown, effect, *as_counted(unknown, recording, 7.0))[:2, late]
    assert (np.sqrt((wanted**2).mean(axis=1)) > MOVED).all()
    assert (np.abs(found - wanted).max(axis=1) < 0.02 * np.abs(wanted).max(axis=1)).all()


def test_pulses_of_persons_answer_with_the_effect_that_follows_them(warm):
    """At an amplitude that is not zero, what one more person does is what both runs with the window say."""
    simulator, recording = warm
    effect = effects(simulator.system)["window.warm"]
    problem = Problem(simulator, recording, occupancy="unknown", uncertain=False, warm_up=HALF_HOUR, effects=[effect])
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
