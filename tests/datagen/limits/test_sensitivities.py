"""Differences of simulations: within the range of what is moved, from a start that is spun up."""

import numpy as np
import pytest

from datagen.driving.sampling import sample_parameters
from datagen.limits.sensitivities import around, random_window
from datagen.simulating.simulator import Simulator


def test_a_parameter_is_moved_within_its_range_and_in_its_own_scale(house):
    linear = house().parameters[0]  # from 4 to 12: its standard deviation is 8 / sqrt(12)
    move = 0.02 * 8 / np.sqrt(12)
    assert around(linear, 7.0) == pytest.approx((7.0 - move, 7.0 + move), rel=1e-4)
    assert around(linear, 4.0) == (4.0, pytest.approx(4.0 + move, rel=1e-4))
    assert around(linear, 11.99) == (pytest.approx(11.99 - move, rel=1e-4), 12.0)
    decades = linear.model_copy(update={"scale": "log", "min": 1e-3, "max": 1e3})
    for value in (2e-3, 1.0, 900.0):  # the standard deviation of the logarithm is ln(1e6) / sqrt(12)
        ratio = np.exp(0.02 * np.log(1e6) / np.sqrt(12))
        assert around(decades, value) == pytest.approx((value / ratio, value * ratio), rel=1e-3)
    assert around(decades, 1e-3)[0] == 1e-3


def test_a_parameter_over_decades_stays_in_its_range_where_it_is_small(house, monkeypatch):
    """On the linear scale it would be moved to less than nothing."""
    system = house()
    wide = system.parameters[0].model_copy(update={"scale": "log", "min": 1e-2})
    system = system.model_copy(update={"parameters": [wide, *system.parameters[1:]]})
    smallest = int(np.argmin([sample_parameters(system, 1, index)[0] for index in range(40)]))
    given, run = [], Simulator.run

    def seen(self, values, *args, **options):
        given.append(values[wide.name])
        return run(self, values, *args, **options)

    monkeypatch.setattr(Simulator, "run", seen)
    random_window(system, 24.0, 1, smallest)
    value = sample_parameters(system, 1, smallest)[0]
    assert value < 0.02 * np.std(wide.from_unit(np.linspace(0, 1, 2001)))
    assert wide.min <= min(given) < value < max(given) < 1.1 * value


def test_steps_that_do_not_divide_the_spin_up_have_a_limit(house):
    """Ten days are not a whole number of steps of 7 h."""
    system = house().with_experiment(hours=70.0, step=7 * 3600.0)
    window = random_window(system, 14.0, 1, 0)
    assert window.visited.shape[0] == 36  # 35 steps are the least that hold ten days
    assert np.isfinite(window.parameters).all()
