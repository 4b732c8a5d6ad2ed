"""Derivatives where one side, or both, cannot be simulated, and factors of precisions where rounding spoils these."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.gaussian import factor, no_less_than_nothing
from diagnosis.fitting.linear import LOST, one_sided, responses
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.recording import read_recording
from shared.errors import SimulationError
from tests.diagnosis.conftest import WARM_UP

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


HOUR = 3600.0
FORGETS = {2.0: (2.0, 1.0), 28.0: (7.0, 4.0)}
"""Resistance and capacity of houses, by what they take to forget [h]."""


def test_pulses_that_share_a_simulation_answer_as_alone(house, house_recording):
    """This house forgets by a factor of 50 in half a day; pulses that turn are followed as long, others twice that."""
    system = house("me")
    record = read_recording(house_recording(hours=96, count=False), system)
    problem = Problem(Simulator(system), record, occupancy="unknown", known=["history"], warm_up=WARM_UP * HOUR)
    z = problem.unknowns({"ro": 2.5, "ri": 0.6, "c": 1.2, "a": 2.5})  # forgets within 3 h
    base = problem.simulate(z)

    def simulate(runs):
        return problem.simulate_all([(z, problem.nuisance.mean + one) for one in runs])

    together = responses(problem.nuisance, simulate, base, problem.time) * problem.nuisance.sd
    ever = replace(problem.nuisance, followed=np.full(problem.nuisance.size, 1e9))
    alone = responses(ever, simulate, base, problem.time) * problem.nuisance.sd
    np.testing.assert_allclose(together, alone, atol=1e-2 * np.abs(alone).max())
    assert np.sum((together - alone) ** 2) < 1e-4 * np.sum(alone**2)
    assert np.abs(alone).max() > 0


@pytest.mark.parametrize("hours", FORGETS)
def test_changes_within_steps_are_followed_as_long_as_a_house_remembers_them(house, house_recording, hours):
    system = house("me")
    record = read_recording(house_recording(hours=240), system)
    problem = Problem(Simulator(system), record, replay=True, known=["history"], warm_up=WARM_UP * HOUR)
    assert problem.nuisance.turns.all()
    z = problem.unknowns({"ro": FORGETS[hours][0], "c": FORGETS[hours][1], "ri": 0.6, "a": 2.5})
    around = problem.linearise(z)
    ever = replace(problem.nuisance, followed=np.full(problem.nuisance.size, 1e9))
    alone = responses(ever, lambda runs: problem.simulate_all([(z, one) for one in runs]), around.outputs, problem.time)
    assert around.response.any()
    assert _lost(problem, around.response, alone) < 2 * LOST
    assert 2 * hours * HOUR <= around.lasting or around.lasting >= 8 * HOUR


def _lost(problem, response, alone):
    """Of the mean square of what turned pulses do and of the noise, the share that a response lacks."""
    scale = problem.nuisance.sd / problem.floor[:, None, None]
    missing, whole = (np.sum(((one * scale)[problem.observed]) ** 2) for one in (alone - response, alone))
    return missing / (whole + problem.observed.sum())


def exact_logdet(columns):
    """log det(1 + C'C) in rational numbers."""
    n = columns.shape[1]
    rows = [[Fraction(float(x)) for x in row] for row in columns]
    gram = [[sum(r[i] * r[j] for r in rows) + (i == j) for j in range(n)] for i in range(n)]
    det = Fraction(1)
    for k in range(n):
        det *= gram[k][k]
        for i in range(k + 1, n):
            share = gram[i][k] / gram[k][k]
            gram[i] = [a - share * b for a, b in zip(gram[i], gram[k], strict=True)]
    return float(np.log(float(det)))


@pytest.mark.parametrize("size", [1.0, 1e9])
def test_a_factor_of_columns_that_are_nearly_alike(size):
    """Of columns a billion times as long as the prior's one, Cholesky's own factor does not exist any more."""
    rng = np.random.default_rng(0)
    columns = size * np.repeat(rng.standard_normal((9, 1)), 4, axis=1)
    columns[:, 3] = rng.standard_normal(9)
    lower = factor(columns.T @ columns)
    assert np.allclose(lower, np.tril(lower)) and (np.diag(lower) > 0).all()
    scale = np.sqrt(1 + np.sum(columns**2, axis=0))
    np.testing.assert_allclose(
        (lower @ lower.T - np.eye(4) - columns.T @ columns) / np.outer(scale, scale), 0, atol=1e-12
    )
    if size == 1.0:
        assert 2 * np.sum(np.log(np.diag(lower))) == pytest.approx(exact_logdet(columns), rel=1e-12)


def test_a_long_column_costs_a_short_one_nothing():
    gram = np.diag([1e30, 4.0, 0.0])
    gram[0, 1] = gram[1, 0] = -1.3e15 * 2.0  # beyond what two columns can have: rounding
    left = no_less_than_nothing(gram)
    assert left[2, 2] == 0 and left[1, 1] == pytest.approx(4.0, rel=0.2)
    assert np.linalg.eigvalsh(left / np.sqrt(np.outer([1e30, 1, 1], [1e30, 1, 1])))[0] > -1e-12
