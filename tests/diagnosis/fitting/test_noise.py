"""The noise model against its covariance matrix written out."""

import numpy as np
import pytest

from diagnosis.fitting.noise import NoiseModel, estimated

HOUR = 3600.0


def dense(noise, k, time):
    """Covariance of the readings of one output at times [s]."""
    lag = np.abs(time[:, None] - time[None])
    return noise.white[k] ** 2 * np.eye(len(time)) + noise.slow[k] ** 2 * np.exp(-lag / noise.time[k])


@pytest.fixture
def noise():
    return NoiseModel(np.array([0.1, 20.0]), np.array([0.3, 0.0]), np.array([6 * HOUR, HOUR]))


def test_whitening_is_the_inverse_root_of_the_covariance(noise):
    rng = np.random.default_rng(0)
    time = HOUR * np.arange(1, 41)
    observed = rng.random((2, 40)) > 0.2
    values = rng.standard_normal((2, 40, 3))
    rows = noise.whiten(values, observed, time)
    a, b = values[0, observed[0]], values[1, observed[1]]
    inverse = np.linalg.inv(dense(noise, 0, time[observed[0]]))
    np.testing.assert_allclose(rows.T @ rows, a.T @ inverse @ a + b.T @ b / 400, rtol=1e-9)
    logdets = [np.linalg.slogdet(dense(noise, k, time[observed[k]]))[1] for k in (0, 1)]
    assert noise.logdet(observed, time) == pytest.approx(sum(logdets), rel=1e-9)


def test_draws_have_the_covariance(noise):
    rng = np.random.default_rng(1)
    time = HOUR * np.array([1.0, 2.0, 5.0, 6.0])
    draws = np.stack([noise.draw(rng, time)[0] for _ in range(20000)])
    np.testing.assert_allclose(np.cov(draws, rowvar=False), dense(noise, 0, time), atol=0.004)


def test_slow_noise_is_found_and_white_noise_is_left_alone(noise):
    rng = np.random.default_rng(2)
    time = HOUR * np.arange(1, 673)
    observed = np.ones((2, 672), dtype=bool)
    found = estimated(NoiseModel.white_only(noise.white), noise.draw(rng, time), observed, time)
    assert found.slow[0] == pytest.approx(0.3, rel=0.3)
    assert found.time[0] == pytest.approx(6 * HOUR, rel=0.6)
    assert found.white[0] == pytest.approx(0.1, rel=0.3)
    assert found.slow[1] == 0.0
    assert found.white[1] == 20.0
