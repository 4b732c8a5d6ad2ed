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


def deviance(found, residual, time):
    """Twice the negative log likelihood by the covariance written out."""
    covariance = dense(found, 0, time)
    return float(residual @ np.linalg.solve(covariance, residual) + np.linalg.slogdet(covariance)[1])


@pytest.mark.parametrize("times", [1.5, 10.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_sensor_that_is_noisier_than_declared_is_not_called_slow(times, seed):
    """White noise of any size is white: a slow error over one step only would nearly do, and be said to be a lack."""
    time, declared = HOUR * np.arange(1, 169), 0.1
    residual = times * declared * np.random.default_rng(seed).standard_normal((1, 168))
    given = NoiseModel.white_only(np.array([declared]))
    found = estimated(given, residual, np.ones((1, 168), dtype=bool), time)
    assert found.slow[0] < 0.5 * declared
    assert found.sd[0] == pytest.approx(np.sqrt(np.mean(residual**2)), rel=0.1)
    plain = NoiseModel.white_only(np.array([np.sqrt(np.mean(residual**2))]))
    assert deviance(found, residual[0], time) <= deviance(plain, residual[0], time) + 1e-6


@pytest.mark.parametrize(("white", "slow", "hours"), [(0.1, 0.5, 6.0), (0.3, 0.3, 24.0)])
def test_the_noise_that_is_found_is_at_least_as_likely_as_the_true_one(white, slow, hours):
    time = HOUR * np.arange(1, 337)
    true = NoiseModel(np.array([white]), np.array([slow]), np.array([hours * HOUR]))
    given = NoiseModel.white_only(np.array([0.1]))
    for seed in range(4):
        residual = true.draw(np.random.default_rng(seed), time)
        found = estimated(given, residual, np.ones((1, 336), dtype=bool), time)
        assert found.slow[0] > 0
        assert deviance(found, residual[0], time) < deviance(true, residual[0], time) + 0.5
