"""The ceiling against Bayesian linear regression done the long way, and against what must hold of any limit."""

import numpy as np
import pytest

from datagen.ceilings import Window, _window, ceilings_of, posterior_variance
from shared.errors import SystemDescriptionError


def random_window(system, rng, steps=12, states=3, pulses=5):
    outputs = len(system.outputs)
    root = rng.normal(size=(pulses, pulses))
    return Window(
        parameters=rng.normal(size=(outputs, steps, len(system.parameters))),
        states=rng.normal(size=(outputs, steps, states)),
        occupancy=rng.normal(size=(outputs, steps, pulses)),
        occupancy_covariance=root @ root.T,
        visited=rng.normal(size=(steps, states)),
    )


def test_posterior_equals_conditioning_the_joint_gaussian(default_system):
    """Build the joint covariance of all unknowns and data, and condition: no Woodbury, no information form."""
    rng = np.random.default_rng(0)
    window = random_window(default_system, rng)
    state_sd = np.array([0.5, 2.0, 1.0])
    found = posterior_variance(default_system, window, state_sd, "sensor", ["TRoo", "CO2", "TDryBul"])
    rows = [0, 1]
    noise = np.repeat(default_system.noise_sd("sensor")[rows] ** 2, 12)
    design = np.concatenate(
        [m[rows].reshape(24, -1) for m in (window.parameters, window.states, window.occupancy)], axis=1
    )
    n = len(default_system.parameters)
    prior = np.zeros((n + 3 + 5, n + 3 + 5))
    prior[:n, :n] = np.eye(n)
    prior[n : n + 3, n : n + 3] = np.diag(state_sd**2)
    prior[n + 3 :, n + 3 :] = window.occupancy_covariance
    data = design @ prior @ design.T + np.diag(noise)
    cross = prior @ design.T
    posterior = prior - cross @ np.linalg.solve(data, cross.T)
    np.testing.assert_allclose(found, np.diag(posterior)[:n], rtol=1e-6)


@pytest.fixture(scope="module")
def window(default_system):
    return _window(default_system, 24.0, 3, 0)


@pytest.mark.slow
def test_sensitivities_predict_a_finite_change(window, default_system):
    """Two parameters moved by a tenth of their spread: the outputs move as the sensitivities say, within curvature."""
    other = _window(default_system, 24.0, 3, 0)
    np.testing.assert_allclose(other.parameters, window.parameters)  # deterministic
    assert window.parameters.shape == (4, 24, 8)
    assert window.occupancy.shape == (4, 24, 48)
    co2 = default_system.output_names.index("CO2")
    # a person in the room raises CO2 from the hour of the pulse on, never before
    for pulse in range(0, 48, 7):
        hour = pulse // 2
        assert np.abs(window.occupancy[co2, :hour, pulse]).max(initial=0.0) < 1e-3
        assert window.occupancy[co2, hour, pulse] > 0.5


@pytest.mark.slow
def test_less_noise_and_more_channels_tell_more(window, default_system):
    sd = window.visited.std(axis=0)
    two = ["TRoo", "CO2"]
    free = posterior_variance(default_system, window, sd, "none", two)
    noisy = posterior_variance(default_system, window, sd, "sensor", two)
    richer = posterior_variance(default_system, window, sd, "sensor", [*two, "QHea", "mOA"])
    assert np.all((free > 0) & (free <= 1 + 1e-9))
    assert np.all(free <= noisy + 1e-9)
    assert np.all(richer <= noisy + 1e-9)
    assert noisy.mean() - free.mean() > 0.05
    assert noisy.mean() - richer.mean() > 0.02


def test_channels_without_an_output_are_refused(default_system):
    with pytest.raises(SystemDescriptionError, match="hold no output"):
        ceilings_of(default_system, contexts=[24.0], conditions=[("none", ["TDryBul"])], systems=1)


def test_a_channel_that_is_not_there_is_refused_by_name(default_system):
    conditions = [("none", ["TRoo", "TDryBul"]), ("none", ["TRoo", "C02", "time_of_day"])]
    with pytest.raises(SystemDescriptionError, match=r"\['C02', 'time_of_day'\] are neither .*'TRoo', .*'TDryBul'"):
        ceilings_of(default_system, contexts=[24.0], conditions=conditions, systems=1)
