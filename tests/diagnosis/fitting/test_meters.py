"""Readings cleared of their meter's noise: against dense algebra, against the truth, and what it does to a slope."""

import numpy as np
import pytest

from diagnosis.fitting import inputs as meters
from diagnosis.fitting.inputs import MEMORIES, MEMORY, SLOW, cleared
from diagnosis.recording import HOUR

STEPS, SD = 168, 0.01
WIDE = 10.0


def process(rng, steps: int, size: float, hours: float) -> np.ndarray:
    """An Ornstein-Uhlenbeck process, drawn step by step."""
    decay, values = np.exp(-1 / hours), np.empty(steps)
    values[0] = size * rng.standard_normal()
    for i in range(1, steps):
        values[i] = decay * values[i - 1] + size * np.sqrt(1 - decay**2) * rng.standard_normal()
    return values


def meter(rng, true: np.ndarray) -> np.ndarray:
    """Readings of it: noise of SD in all, of which a part is slow."""
    slow = process(rng, len(true), np.sqrt(SLOW) * SD, MEMORY / HOUR)
    return true + slow + np.sqrt(1 - SLOW) * SD * rng.standard_normal(len(true))


def rooms_read(count: int, steps: int = STEPS):
    """Air flows that hardly vary, and their readings."""
    for seed in range(count):
        rng = np.random.default_rng(seed)
        size = SD * np.exp(rng.uniform(*np.log([meters.SMALLEST, 2.0])))
        true = 0.2 + process(rng, steps, size, rng.choice(MEMORIES) / HOUR)
        yield true, meter(rng, true)


def test_it_is_the_expectation_of_gaussian_processes(monkeypatch):
    monkeypatch.setattr(meters, "NEGLIGIBLE", 0.0)
    _, readings = next(rooms_read(1, 40))
    readings[[3, 20, 21]] = np.nan
    found = cleared(readings, SD, HOUR)
    seen, time = np.isfinite(readings), np.arange(40.0)
    mean, spread = readings[seen].mean(), readings[seen].std()
    apart = np.abs(time[:, None] - time)
    noise = SD**2 * (SLOW * np.exp(-apart * HOUR / MEMORY) + (1 - SLOW) * np.eye(40))
    total, values, covariance = [], [], []
    for size in np.geomspace(meters.SMALLEST * SD, 3 * max(spread, SD), meters.SIZES):
        for memory in MEMORIES:
            own = size**2 * np.exp(-apart * HOUR / memory) + WIDE**2  # the level, as good as unknown
            both = (own + noise)[np.ix_(seen, seen)]
            gain = np.linalg.solve(both, own[seen]).T
            left = readings[seen] - mean
            total.append(-0.5 * (left @ np.linalg.solve(both, left) + np.linalg.slogdet(both)[1]))
            values.append(mean + gain @ left)
            covariance.append(own - gain @ own[seen])
    share = np.exp(np.array(total) - max(total))
    share /= share.sum()
    expected = share @ np.array(values)
    np.testing.assert_allclose(found.values, expected, atol=1e-6)
    away = np.array(values) - expected
    wide = np.einsum("k,kij->ij", share, np.array(covariance)) + (share * away.T) @ away
    np.testing.assert_allclose(found.covariance(np.eye(40)), wide, atol=1e-8)
    day = np.kron(np.eye(5), np.full(8, 1 / 8))
    np.testing.assert_allclose(found.covariance(day), day @ wide @ day.T, atol=1e-8)


def test_errors_are_smaller_and_as_large_as_it_says():
    apart, before, ratio = [], [], []
    for true, readings in rooms_read(40):
        found = cleared(readings, SD, HOUR)
        for hours in (1, 6):
            means = np.kron(np.eye(STEPS // hours), np.full(hours, 1 / hours))
            ratio.append(np.mean((means @ (found.values - true)) ** 2 / np.diag(found.covariance(means))))
        apart.append(np.mean((found.values - true) ** 2))
        before.append(np.mean((readings - true) ** 2))
    assert np.mean(apart) < 0.4 * np.mean(before)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.25)


def test_a_slope_is_not_flattened():
    """What answers to the true flow, regressed on its readings and on what is expected of them."""
    raw, clear = np.zeros((2, 2)), np.zeros((2, 2))
    for true, readings in rooms_read(60):
        raw += np.cov(readings, true)
        clear += np.cov(cleared(readings, SD, HOUR).values, true)
    assert raw[0, 1] / raw[0, 0] < 0.5
    assert clear[0, 1] / clear[0, 0] == pytest.approx(1.0, abs=0.12)


def test_a_large_signal_stays():
    rng = np.random.default_rng(1)
    true = 0.2 + 0.3 * ((np.arange(STEPS) % 24 > 8) & (np.arange(STEPS) % 24 < 17))
    readings = meter(rng, true)
    found = cleared(readings, SD, HOUR)
    assert np.sqrt(np.mean((found.values - true) ** 2)) < 1.2 * SD
    assert np.corrcoef(found.values, true)[0, 1] > 0.995


@pytest.mark.parametrize("sd", [0.0, SD])
def test_without_noise_or_variation_readings_are_held(sd):
    readings = np.full(30, 5.0) if sd else np.linspace(1.0, 2.0, 30)
    lost = readings.copy()
    lost[[0, 7]] = np.nan
    found = cleared(lost, sd, HOUR)
    expected = readings.copy()
    expected[0], expected[7] = readings[1], readings[6]
    np.testing.assert_array_equal(found.values, expected)
    assert not found.covariance(np.eye(30)).any()
