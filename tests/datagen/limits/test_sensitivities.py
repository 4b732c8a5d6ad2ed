"""Differences of simulations: within the range of what is moved, from a start that is spun up."""

import numpy as np
import pytest

from datagen import identifiability
from datagen.driving.sampling import sample_parameters
from datagen.limits.sensitivities import around, random_window


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


def test_both_kinds_of_one_fmu_have_one_limit(small_fmu, house):
    """Model Exchange moves the states themselves; Co-Simulation sees what other pasts do to the window."""
    fmu = small_fmu("house", 2, ("me", "cs"), attributes='canHandleVariableCommunicationStepSize="true"')
    kinds = [house("N").model_copy(update={"fmu": str(fmu), "kind": one}) for one in ("ModelExchange", "CoSimulation")]
    limits = [identifiability(one, context=24.0, noise="sensor", systems=2) for one in kinds]
    exchange, cosimulation = ([*one.r2.values()] for one in limits)
    assert 0.1 < min(exchange) < max(exchange) < 0.99
    assert cosimulation == pytest.approx(exchange, abs=0.01)


def first_order(small_system, **experiment):
    """x' = (u - x) / tau from x = 0, u = 1 throughout; its record is a day."""
    text = {"outputs": {"x": "point"}, "parameters": ("tau",), "inputs": {"u": "linear"}}
    lag = small_system("lag", **text, step=0.125, hours=5 / 3600)
    inputs = [one.model_copy(update={"value": 1.0}) for one in lag.inputs]
    outputs = [one.model_copy(update={"accuracy": 1e-3}) for one in lag.outputs]
    changed = lag.experiment.model_copy(update=experiment)
    return lag.model_copy(update={"inputs": inputs, "outputs": outputs, "experiment": changed})


def test_a_record_that_is_not_warmed_up_tells_how_it_settles(small_system):
    """Against pencil and paper: the window is the record, and begins with the state of the FMU, which is known."""
    system = first_order(small_system)
    tau = float(sample_parameters(system, 1, 0)[0])
    window = random_window(system, 5 / 3600, 1, 0)
    t = 0.125 * np.arange(1, 41)
    exact = -t / tau**2 * np.exp(-t / tau) * 1.5 / np.sqrt(12)  # by a prior standard deviation of tau
    np.testing.assert_allclose(window.parameters[0, :, 0], exact, rtol=1e-3, atol=1e-6)
    assert not window.states.any() and window.visited.shape == (0, 1)
    found = identifiability(system, context=5 / 3600, noise="none", systems=3)
    assert found.r2["tau"] > 0.99
