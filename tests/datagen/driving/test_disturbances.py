"""Effects that act on simulated systems: how many, what a sensor shows, and what is recorded."""

import numpy as np
import pytest

from datagen.driving.disturbances import Disturbances, number_of, sample_disturbances
from datagen.driving.tables import Piecewise
from datagen.simulating.drawn import simulate_system
from datagen.simulating.simulator import Simulator
from shared.effects import SensorEffect
from shared.system import load_system

DAY = 86400.0


@pytest.fixture(scope="module")
def system():
    return load_system("MixedAirCO2").with_experiment(hours=72.0)


def test_a_share_of_the_systems_is_disturbed():
    counts = np.array([number_of(5, k, 0.4) for k in range(2000)])
    assert np.mean(counts > 0) == pytest.approx(0.4, abs=0.04)
    assert set(counts) == {0, 1, 2}
    assert not any(number_of(5, k, 0.0) for k in range(50))


def test_what_acts_is_of_the_description_and_within_its_bounds(system):
    effects = {one.name: one for one in system.effects}
    for index in range(200):
        drawn = sample_disturbances(system, 5, index, 1.0, -DAY, 3 * DAY)
        assert len(drawn.names) == number_of(5, index, 1.0)
        assert all("control" in effects[name].modes for name in drawn.names)
        for name, changes in drawn.changes.items():
            assert name in system.input_names
            signal = Piecewise(np.arange(-1, 4) * DAY, np.full(5, 3.0))
            for change in changes:
                signal = change(signal)
            assert np.isfinite(signal.at(np.linspace(0, 3 * DAY, 50))).all()


def read(system, operation, amplitude, values, **more):
    common = {"name": "s", "unit": "1", "kind": "sensor", "scale": 1.0, "lower": 0.0, "upper": 9e9}
    effect = SensorEffect(**common, outputs=["TRoo"], operation=operation, **more)
    outputs = np.zeros((len(system.output_names), len(values)))
    outputs[0] = values
    time = 600.0 * np.arange(1, len(values) + 1)
    return Disturbances(sensors=[(effect, amplitude)]).applied(system, time, outputs)[0]


def test_erring_sensors_show_what_their_law_says(system):
    values = 290.0 + np.sin(np.arange(2000) / 30.0)
    assert np.allclose(read(system, "bias", 0.5, values), values + 0.5)
    assert np.allclose(read(system, "gain", 0.1, values, about=294.15), 1.1 * values - 0.1 * 294.15)
    drift = read(system, "drift", 0.6, values) - values
    assert drift[0] == 0 and drift[-1] == pytest.approx(0.6 * 1999 * 600 / (30 * DAY))
    step = np.where(np.arange(2000) < 100, 290.0, 291.0)
    lagged = read(system, "lag", 3600.0, step)
    # a first-order answer to a step: 1 - exp(-t / tau)
    assert lagged[99 + 12] == pytest.approx(291.0 - np.exp(-12 * 600 / 3600.0), abs=1e-9)
    assert np.allclose(read(system, "shift", 1200.0, values)[2:], values[:-2])


def test_inputs_are_recorded_as_an_engineer_has_them(system):
    simulator = Simulator(system)
    moved = 0
    for index in range(12):
        calm = simulate_system(simulator, root_seed=8, index=index)
        disturbed = simulate_system(simulator, root_seed=8, index=index, disturbed=1.0)
        assert np.array_equal(calm.inputs, disturbed.inputs)
        moved += not np.allclose(calm.outputs, disturbed.outputs, rtol=1e-6)
    assert moved >= 8
