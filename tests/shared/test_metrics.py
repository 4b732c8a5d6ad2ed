"""The figures of merit against hand computation and scipy."""

import numpy as np
import pytest
from scipy.stats import linregress

from shared.metrics import bootstrap_by_system, r2, relative_accuracy


def test_r2_by_hand():
    truth = np.array([[1.0], [2.0], [3.0]])
    estimate = np.array([[1.0], [2.0], [5.0]])
    assert r2(truth, estimate)[0] == pytest.approx(1 - 4 / 2)


def test_r2_equals_squared_correlation_of_a_least_squares_fit():
    rng = np.random.default_rng(0)
    x = rng.normal(size=200)
    y = 2 * x + rng.normal(size=200)
    fit = linregress(x, y)
    assert r2(y[:, None], (fit.slope * x + fit.intercept)[:, None])[0] == pytest.approx(fit.rvalue**2, rel=1e-10)


def test_r2_of_a_constant_truth_is_not_a_number():
    assert np.isnan(r2(np.ones((3, 1)), np.zeros((3, 1)))[0])


def test_rounding_is_no_variation():
    """The mean of equal numbers is seldom that very number: R2 was -1e30 for windows of one system."""
    truths = np.random.default_rng(5).uniform(1e-6, 1e3, size=200)
    assert all(np.isnan(r2(np.full((31, 1), one), np.full((31, 1), 1.1 * one))[0]) for one in truths)


def test_relative_accuracy_is_equation_3():
    assert relative_accuracy(np.array([2.0, 4.0]), np.array([1.0, 5.0])).tolist() == [0.5, 0.75]


def test_interval_resamples_systems_not_windows():
    rng = np.random.default_rng(1)
    systems = np.repeat(np.arange(30), 100)
    level = rng.normal(size=30)[systems]
    low, high = bootstrap_by_system(systems, lambda rows: np.array(level[rows].mean()), draws=2000)
    # 100 copies of each system carry no more than one: the interval is that of 30 values
    sd = level[::100].std() / np.sqrt(30)
    assert (high - low) == pytest.approx(2 * 1.645 * sd, rel=0.05)


@pytest.mark.parametrize(("count", "known"), [(1, False), (2, False), (3, False), (8, True)])
def test_of_few_systems_there_is_no_interval(count, known):
    """Resamples of one system alone have no R2; leaving them out would narrow the interval to the estimate itself."""
    rng = np.random.default_rng(2)
    systems = np.repeat(np.arange(count), 20)
    truth = rng.uniform(0.1, 0.7, size=count)[systems][:, None]
    estimate = truth + rng.normal(0, 0.1, size=truth.shape)
    low, high = bootstrap_by_system(systems, lambda rows: r2(truth[rows], estimate[rows]))
    assert np.isfinite([low, high]).all() == known
    assert not known or low[0] < r2(truth, estimate)[0] < high[0]
