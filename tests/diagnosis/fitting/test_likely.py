"""Leaps of the nuisance, against a history that is known."""

import numpy as np
import pytest

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.fitting.likely import FAR, joint_cost, leapt, unknowns_of
from diagnosis.fitting.problem import Problem
from diagnosis.recording import HOUR, read_recording

DAYS = 3
NOON = 36 * HOUR
"""After the recording's start: in the middle of its second day."""


@pytest.fixture(scope="module")
def room(default_system, tmp_path_factory):
    """A room that holds its CO2 at the set point as soon as a few persons are in it; nobody counted them."""
    path = tmp_path_factory.mktemp("leaps") / "room.nc"
    simulate(default_system, parameters={}, hours=24.0 * DAYS, seed=3, out=path)
    system = default_system.with_experiment(step=HOUR, hours=24.0 * DAYS)
    return Problem(Simulator(system), read_recording(path, system), occupancy="unknown")


def crowded(problem, out):
    """A full house on every day but for an hour at noon of the second, when ``out`` of them are out."""
    nuisance = problem.nuisance
    present = nuisance.recorded & (nuisance.mean > 0.5 * nuisance.mean.max())
    heights = np.where(present, nuisance.mean + nuisance.sd, np.maximum(nuisance.mean, 0.0))
    noon = (nuisance.begin >= problem.drive.start + NOON - 1) & (nuisance.end <= problem.drive.start + NOON + HOUR + 1)
    return np.where(noon, (1 - out) * heights, heights)


def test_an_absence_behind_a_saturated_controller_is_found(room):
    z = np.zeros(room.size)
    full = unknowns_of(room.nuisance, crowded(room, 0.0))
    truth = unknowns_of(room.nuisance, crowded(room, 1.0))
    other = room.with_measured(room.simulate(z, room.nuisance.heights(truth)))
    outputs = other.simulate(z, other.nuisance.heights(full))
    stuck = joint_cost(other, full, outputs)
    assert stuck - full @ full > FAR**2  # it shows
    found = leapt(other, z, full, outputs)
    cost = joint_cost(other, found, other.simulate(z, other.nuisance.heights(found)))
    assert cost < 0.5 * stuck
    noon = np.abs(crowded(room, 0.0) - crowded(room, 1.0)) > 0
    heights = other.nuisance.heights(found)
    assert heights[noon].mean() < 0.4 * crowded(room, 0.0)[noon].mean()
    # elsewhere they stay
    far = other.nuisance.recorded & (np.abs(other.nuisance.begin - room.drive.start - NOON) > 12 * HOUR)
    np.testing.assert_allclose(heights[far], other.nuisance.heights(full)[far], atol=0.5)
