"""Intervals of R2 and of shares: how often they hold what was put in."""

import numpy as np
import pytest

from shared.metrics import r2
from trainer.intervals import r2_interval, share_interval


def rooms(count: int, true: float, rng: np.random.Generator, windows: int = 2) -> tuple[np.ndarray, ...]:
    """System, truth and estimate of windows: eight parameters whose R2 over all rooms there could be is the same."""
    truth = rng.uniform(size=(count, 8)) * np.sqrt(12)
    room = np.sqrt(0.7 * (1 - true)) * rng.standard_normal((count, 8))
    where = np.repeat(np.arange(count), windows)
    window = np.sqrt(0.3 * (1 - true)) * rng.standard_normal((count * windows, 8))
    return where, truth[where], (truth + room)[where] + window


@pytest.mark.slow
@pytest.mark.parametrize(("count", "true"), [(10, 0.6), (17, -1.0)])
def test_the_interval_of_a_mean_r2_holds_it(count, true):
    """Percentiles of resamples held it in 33 to 77 %, and did not always hold the estimate."""
    rng = np.random.default_rng(7)
    held = 0
    for _ in range(200):
        where, truth, estimate = rooms(count, true, rng)

        def mean(rows, truth=truth, estimate=estimate):
            return np.append(r2(truth[rows], estimate[rows]), r2(truth[rows], estimate[rows]).mean())

        low, high = r2_interval(where, mean)
        found = mean(np.arange(len(where)))
        assert (low <= found).all() and (found <= high).all()
        held += low[-1] <= true <= high[-1]
    assert 0.85 <= held / 200 <= 0.97


def test_the_interval_of_many_systems_is_that_of_the_residuals():
    """With thousands of systems the only error is of the mean square: R2's standard error is the delta method's."""
    rng = np.random.default_rng(3)
    truth, error = rng.standard_normal(3000), np.sqrt(0.4) * rng.standard_normal(3000)
    low, high = r2_interval(np.arange(3000), lambda rows: r2(truth[rows, None], (truth + error)[rows, None]))
    # log(1 - R2) is a difference of the logarithms of two independent variances, each with 2 / n
    assert np.log((1 - low[0]) / (1 - high[0])) == pytest.approx(2 * 1.645 * np.sqrt(4 / 3000), rel=0.05)


@pytest.mark.parametrize(("count", "known"), [(1, False), (3, False), (4, True)])
def test_of_few_systems_there_is_no_interval_of_r2(count, known):
    rng = np.random.default_rng(2)
    systems = np.repeat(np.arange(count), 20)
    truth = rng.uniform(0.1, 0.7, size=count)[systems][:, None]
    estimate = truth + rng.normal(0, 0.1, size=truth.shape)
    low, high = r2_interval(systems, lambda rows: r2(truth[rows], estimate[rows]))
    assert np.isfinite([low, high]).all() == known
    assert not known or low[0] < r2(truth, estimate)[0] < high[0]


def test_an_estimate_that_is_right_has_r2_1_throughout():
    truth = np.random.default_rng(4).uniform(size=(9, 1))
    low, high = r2_interval(np.arange(9), lambda rows: r2(truth[rows], truth[rows]))
    assert (low[0], high[0]) == (pytest.approx(1, abs=1e-8), 1)


def test_a_constant_truth_has_no_interval():
    low, high = r2_interval(np.arange(9), lambda rows: r2(np.ones((len(rows), 1)), np.zeros((len(rows), 1))))
    assert np.isnan([low, high]).all()


def test_a_share_of_all_has_an_interval_with_a_width():
    """Ten rooms that are all covered are nothing unusual where nine tenths should be (0.9^10 is 35 %)."""
    inside = np.ones((20, 1))
    low, high = share_interval(np.repeat(np.arange(10), 2), inside)
    assert low[0] < 0.8 and high[0] == 1
    low, high = share_interval(np.repeat(np.arange(10), 2), 1 - inside)
    assert low[0] == 0 and high[0] > 0.2


@pytest.mark.parametrize(("count", "alike"), [(6, 0.3), (10, 0.9)])
def test_the_interval_of_a_share_holds_it(count, alike):
    """Of windows of which a share has the fate of their room; percentiles of resamples held it in 64 to 87 %."""
    rng, held = np.random.default_rng(5), 0
    where = np.repeat(np.arange(count), 4)
    for _ in range(500):
        room, window = rng.random(count) < 0.9, rng.random(4 * count) < 0.9
        inside = np.where(rng.random(4 * count) < alike, room[where], window)[:, None].astype(float)
        low, high = share_interval(where, inside)
        held += low[0] <= 0.9 <= high[0]
    assert held / 500 >= 0.85
