"""Derivatives where one side, or both, cannot be simulated."""

import numpy as np
import pytest

from diagnosis.fitting.linear import one_sided, responses
from diagnosis.fitting.nuisance import Nuisance
from shared.errors import SimulationError

BOUNDS = np.full(2, -3.0), np.full(2, 3.0)


def plane(z, fails=lambda z: False):
    """Outputs (1, 2) that are linear in z (2,)."""
    if fails(z):
        raise SimulationError("fails here")
    return np.array([[2.0 * z[0] - z[1], 5.0 * z[1]]])


@pytest.mark.parametrize(
    ("fails", "found"),
    [
        (lambda z: False, [[-1.0, 5.0]]),
        (lambda z: z[1] > 1.0, [[-1.0, 5.0]]),
        (lambda z: z[1] < 1.0, [[-1.0, 5.0]]),
        (lambda z: z[1] != 1.0, None),
    ],
)
def test_the_side_that_can_be_simulated_gives_the_derivative(fails, found):
    made = one_sided(lambda z: plane(z, fails), np.array([0.5, 1.0]), 1, BOUNDS, 0.1)
    assert made is None if found is None else made == pytest.approx(np.array(found))


def test_pulses_whose_simulation_fails_are_measured_the_other_way_round():
    """Two pulses on one input; whatever raises it from the second hour on cannot be simulated."""
    time = np.array([1.0, 2.0, 3.0]) * 3600.0
    pulses = Nuisance(
        column=np.zeros(2, dtype=int),
        begin=np.array([0.0, 3600.0]),
        end=np.array([3600.0, 7200.0]),
        turns=np.zeros(2, dtype=bool),
        recorded=np.ones(2, dtype=bool),
        mean=np.zeros(2),
        factor=np.eye(2),
    )

    def simulate(runs):
        for one in runs:
            if one[1] > 0:
                raise SimulationError("too much")
        return [np.array([[3.0 * one[0], one[0] + 4.0 * one[1], one.sum()]]) for one in runs]

    found = responses(pulses, simulate, np.zeros((1, 3)), time)
    assert found[0, :, 0] == pytest.approx([3.0, 1.0, 1.0])
    assert found[0, :, 1] == pytest.approx([0.0, 4.0, 1.0])
