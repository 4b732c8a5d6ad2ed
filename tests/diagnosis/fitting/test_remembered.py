"""Simulations that were just made: answered from memory, and never for another run."""

from dataclasses import replace

import numpy as np
import pytest

from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.remembered import KEPT, Remembered
from diagnosis.fitting.run import Run
from diagnosis.recording import read_recording
from shared.errors import SimulationError


class Counting:
    """Answers with what it is given, and how often it was asked."""

    def __init__(self):
        self.asked = 0

    def map(self, runs):
        self.asked += len(runs)
        return [SimulationError("no") if run.parameters["a"] < 0 else np.full((1, 2), self.asked * 1.0) for run in runs]


def a_run(value=1.0):
    table = merge({"x": Piecewise(np.array([0.0, 5.0]), np.array([1.0, 2.0]))}, 0.0, 10.0)
    return Run({"a": value, "b": 2.0}, table, start=0.0, stop=10.0, record_from=0.0)


def test_what_was_asked_singly_is_not_simulated_again():
    runner, memory = Counting(), Remembered()
    (first,), made = memory.map(runner, [a_run()])
    assert made == 1
    kept = first.copy()
    first += 100.0  # what was handed out is not what is remembered
    outcomes, made = memory.map(runner, [a_run(2.0), a_run(), a_run(3.0)])
    assert (made, runner.asked) == (2, 3)
    np.testing.assert_array_equal(outcomes[1], kept)
    assert [one[0, 0] for one in (outcomes[0], outcomes[2])] == [3.0, 3.0]
    _, made = memory.map(runner, [a_run(2.0)])  # runs of a batch are not kept
    assert made == 1


def test_failures_and_what_is_long_ago_are_simulated_again():
    runner, memory = Counting(), Remembered()
    for _ in range(2):
        (found,), made = memory.map(runner, [a_run(-1.0)])
        assert isinstance(found, SimulationError) and made == 1
    for k in range(KEPT + 1):
        memory.map(runner, [a_run(float(k))])
    assert memory.map(runner, [a_run(1.0)])[1] == 0
    assert memory.map(runner, [a_run(0.0)])[1] == 1


@pytest.mark.parametrize(
    "other",
    [
        {"parameters": {"a": 1.0, "b": 2.5}},
        {"inputs": replace(a_run().inputs, left=a_run().inputs.left + 1e-9)},
        {"inputs": replace(a_run().inputs, right=a_run().inputs.right + 1e-9)},
        {"stop": 9.0},
        {"record_from": 1.0},
        {"replay": True},
        {"tolerance": 1e-7},
    ],
)
def test_another_run_is_simulated(other):
    runner, memory = Counting(), Remembered()
    memory.map(runner, [a_run()])
    assert memory.map(runner, [replace(a_run(), **other)])[1] == 1


def test_a_fit_is_the_same_to_the_last_bit_and_takes_fewer_simulations(house, house_recording, monkeypatch):
    system = house("me")
    record, simulator = read_recording(house_recording(hours=48), system), Simulator(system)
    found = fit(Problem(simulator, record, history=False))
    monkeypatch.setattr(Remembered, "map", lambda _, runner, runs: (runner.map(runs), len(runs)))
    plain = fit(Problem(simulator, record, history=False))
    np.testing.assert_array_equal(found.z, plain.z)
    np.testing.assert_array_equal(found.covariance, plain.covariance)
    assert found.simulations < plain.simulations - 5
