"""Derivatives that go along with the steps of a refit."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.problem import Problem
from diagnosis.gap.linear import linearised
from diagnosis.gap.refit import TELLING, _at
from diagnosis.recording import read_recording


@pytest.fixture(scope="module")
def point(house, house_recorded, tmp_path_factory):
    """A linearisation of four days of the house."""
    system = house("me")
    record = read_recording(house_recorded(tmp_path_factory.mktemp("point"), hours=96, seed=2), system)
    problem = Problem(Simulator(system.with_experiment(step=record.step, hours=96.0)), record)
    z = np.zeros(problem.size)
    return linearised(problem, z, problem.linearise(z))


def test_after_a_step_derivatives_lead_to_where_it_came_from(point):
    """Broyden's condition; across the step they are as they were."""
    way = np.array([0.3, -0.2, 0.1, 0.25])[: len(point.z)]
    found = _at(point.problem, point.z + way, point)
    np.testing.assert_allclose(found.by_unknown @ way, found.outputs - point.outputs, atol=1e-10)
    across = np.array([way[1], -way[0], 0.0, 0.0])[: len(way)]
    np.testing.assert_allclose(found.by_unknown @ across, point.by_unknown @ across, atol=1e-10)
    assert np.abs(found.by_unknown - point.by_unknown).max() > 1e-3


@pytest.mark.parametrize("share", [0.0, 1e-9, 0.5])
def test_a_step_that_is_none_corrects_no_derivative(point, share):
    """What was missed is then the integrator's error, however large it is beside the step."""
    near = replace(point, outputs=point.outputs + 1e-6)
    found = _at(point.problem, point.z + share * TELLING / np.sqrt(len(point.z)), near)
    np.testing.assert_array_equal(found.by_unknown, near.by_unknown)
