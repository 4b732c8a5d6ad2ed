"""Runs in two parts: the same outputs, and not cut where an FMU remembers more than its states."""

from types import SimpleNamespace

import numpy as np
import pytest

from datagen.driving.tables import Piecewise, merge
from datagen.simulating.simulator import Simulator, Trajectory
from diagnosis.fitting.simulations import Run, Warmed
from diagnosis.recording import HOUR

BEFORE, LENGTH = 48 * HOUR, 24 * HOUR


@pytest.fixture
def room(default_system):
    """A simulator of the default system and a run with persons from the tenth hour of the recording on."""
    system = default_system.with_experiment(step=HOUR, hours=LENGTH / HOUR)
    usual = {"TDryBul": 278.0, "TSky": 268.0, "winSpe": 3.0, "TSet": 294.0}
    signals = {one.name: Piecewise([0.0], [usual.get(one.name, 0.0)], "previous") for one in system.inputs}

    def run(persons, temperature=278.0):
        changed = {
            one.name: Piecewise([0.0, BEFORE + 10 * HOUR], [0.0, persons], "previous")
            for one in system.inputs
            if one.source == "occupancy"
        } | {"TDryBul": Piecewise([0.0], [temperature], "previous")}
        inputs = merge(signals | changed, 0.0, BEFORE + LENGTH)
        middle = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
        return Run(middle, inputs, start=0.0, stop=BEFORE + LENGTH, record_from=BEFORE, tolerance=1e-6)

    return Simulator(system), run


def test_two_parts_give_what_one_gives(room):
    simulator, run = room
    warmed = Warmed(simulator)
    found = warmed.outputs(run(8.0))
    assert warmed.cut is True
    whole = simulator.run(
        run(8.0).parameters, run(8.0).inputs, start=0.0, stop=BEFORE + LENGTH, record_from=BEFORE, tolerance=1e-6
    ).outputs
    accuracy = np.array([[one.accuracy] for one in simulator.system.outputs])
    assert (np.abs(found - whole) <= 0.3 * accuracy).all()


class Relay:
    """What Model Exchange does not show: it counts how often it was switched, in a variable that it hides."""

    def __init__(self, hidden=True):
        counter = SimpleNamespace(variability="discrete", causality="local")
        self.fmu = SimpleNamespace(cosimulation=False, n_states=1, variables={} if hidden else {"count": counter})
        self.system = SimpleNamespace(outputs=[SimpleNamespace(accuracy=0.01)])

    def run(self, parameters, inputs, *, start, stop, record_from=None, **_):
        switched = 1.0 + (start > 0)
        outputs = np.full((1, 24), switched)
        return Trajectory(np.arange(24.0), outputs, np.empty((0, 24)), np.zeros((2, 1)), {})


@pytest.mark.parametrize("hidden", [True, False])
def test_an_fmu_that_remembers_more_than_its_states_is_not_cut(room, hidden):
    _, run = room
    warmed = Warmed(Relay(hidden))
    assert warmed.cut is (None if hidden else False)
    for _ in range(2):
        np.testing.assert_array_equal(warmed.outputs(run(1.0)), np.ones((1, 24)))
    assert warmed.cut is False
