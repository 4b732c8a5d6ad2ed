"""The figures of merit against hand computation and scipy."""

import numpy as np
import pytest
from scipy.stats import linregress

from shared.metrics import r2, relative_accuracy


def test_r2_equals_squared_correlation_of_a_least_squares_fit():
    rng = np.random.default_rng(0)
    x = rng.normal(size=200)
    y = 2 * x + rng.normal(size=200)
    fit = linregress(x, y)
    assert r2(y[:, None], (fit.slope * x + fit.intercept)[:, None])[0] == pytest.approx(fit.rvalue**2, rel=1e-10)


def test_r2_of_a_constant_truth_is_not_a_number():
    """The mean of equal numbers is seldom that very number: R2 was -1e30 for windows of one system."""
    truths = np.random.default_rng(5).uniform(1e-6, 1e3, size=200)
    assert all(np.isnan(r2(np.full((31, 1), one), np.full((31, 1), 1.1 * one))[0]) for one in truths)


def test_relative_accuracy_is_equation_3():
    assert relative_accuracy(np.array([2.0, 4.0]), np.array([1.0, 5.0])).tolist() == [0.5, 0.75]


def test_relative_accuracy_of_a_parameter_that_passes_zero_is_of_its_mean_size():
    truth = np.array([[-2.0, 2.0], [0.0, 4.0], [4.0, 4.0]])
    assert relative_accuracy(truth, truth + 1.0).tolist() == [[0.5, 0.5], [0.5, 0.75], [0.5, 0.75]]
