"""The determinant's parabola against determinants of linearisations made anew at other unknowns."""

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.fit import determinant
from diagnosis.fitting.problem import Problem
from diagnosis.recording import read_recording


def test_slope_is_the_difference_of_determinants(house, house_recording):
    system = house("me")
    record = read_recording(house_recording(hours=48, count=False), system)
    problem = Problem(Simulator(system), record, occupancy="unknown", history=False)
    problem = problem.with_nuisance(problem.nuisance.only(~problem.nuisance.turns))
    z = problem.unknowns({"ro": 7.0, "ri": 0.6, "c": 4.0, "a": 2.5})
    around = problem.linearise(z)
    found = determinant(problem, around)
    for k, name in enumerate(problem.names):
        width = 0.1 * np.eye(problem.size)[k]
        up, down = (problem.linearise(z + sign * width).marginal.logdet for sign in (1, -1))
        assert found.slope[k] == pytest.approx((up - down) / 0.4, rel=0.15, abs=0.3), name
    assert np.abs(found.slope).max() > 5
    # the level multiplies every answer: B / dz = sd B, and all products are known
    level = problem.nuisance.levels[0]
    by = around.marginal.by_unknown
    product = level.sd * by.T @ np.linalg.solve(np.eye(len(by)) + by @ by.T, by)
    assert found.slope[-1] == pytest.approx(np.trace(product), rel=0.15)
    assert (found.root.T @ found.root)[-1, -1] == pytest.approx(np.sum(product**2), rel=0.3)


@pytest.mark.parametrize("every", [1, 3])
def test_persons_that_were_counted_count_too(house, house_recording, every):
    """What is not known of when they came within the hour can be imitated better by some unknowns than by others.

    With more unknowns of the nuisance than readings, and with fewer.
    """
    system = house("me")
    record = read_recording(house_recording(hours=48), system)
    problem = Problem(Simulator(system), record, history=False)
    problem = problem.with_nuisance(problem.nuisance.only(np.arange(problem.nuisance.size) % every == 0))
    around = problem.linearise(np.zeros(problem.size))
    rows, unknowns = around.marginal.by_unknown.shape
    assert (rows < unknowns) == (every == 1)
    found = determinant(problem, around)
    for k, name in enumerate(problem.names):
        width = 0.1 * np.eye(problem.size)[k]
        up, down = (problem.linearise(sign * width).marginal.logdet for sign in (1, -1))
        assert found.slope[k] == pytest.approx((up - down) / 0.4, rel=0.15, abs=0.3), name
    assert np.abs(found.slope).max() > 5 / every
