"""The default system is a believable room over the whole box of its parameters and a real weather year."""

import numpy as np
import pytest

from datagen.simulating.drawn import simulate_system
from datagen.simulating.simulator import Simulator


@pytest.fixture(scope="module")
def year(default_system):
    simulator = Simulator(default_system)
    runs = [simulate_system(simulator, root_seed=77, index=i) for i in range(8)]
    return {name: np.stack([run.outputs[k] for run in runs]) for k, name in enumerate(default_system.output_names)}


@pytest.mark.slow
def test_99_percent_of_hours_are_plausible(year):
    celsius = year["TRoo"] - 273.15
    plausible = (celsius >= 5) & (celsius <= 40) & (year["CO2"] < 5000)
    assert plausible.mean() >= 0.99
    assert plausible.mean(axis=1).min() >= 0.9


@pytest.mark.slow
def test_both_loops_act_and_saturate_sometimes(year):
    """Rooms are heated in winter and not in summer, ventilation is boosted somewhere, and the air is never stale."""
    heat = year["QHea"]
    january, july = heat[:, : 31 * 24], heat[:, 181 * 24 : 212 * 24]
    assert january.mean() > 1000
    assert july.mean() < 0.1 * january.mean()
    assert heat.min() > -2.0  # the mean of a power that is never negative, within its accuracy
    base = np.quantile(year["mOA"], 0.05, axis=1, keepdims=True)
    assert (year["mOA"] > 1.5 * base).any()
    assert year["CO2"].min() > 400
    assert np.quantile(year["CO2"], 0.999) < 1300  # the loop holds 700 ppm above outdoors
