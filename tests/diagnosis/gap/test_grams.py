"""Colours of noise: recognised, averaged, and what is too large to be one of them."""

import numpy as np
import pytest

from diagnosis.gap.grams import FLOORS, Grams, discrepancy, estimated_colours
from diagnosis.gap.stages import STRONG
from tests.diagnosis.gap.test_linear import HOUR, covariance_of, drawn, problem_of, seen


def test_a_slow_noise_is_recognised_and_a_discrepancy_measured():
    rng = np.random.default_rng(6)
    lin = problem_of(rng, steps=400)
    observed = np.ones(lin.residual.shape, dtype=bool)
    true = {0: (np.sqrt(0.5), np.sqrt(0.5), 10 * HOUR), 1: (1.0, 0.0, HOUR)}
    lin.residual = drawn(rng, lin, true)
    grams = Grams(lin, observed)
    found = estimated_colours(grams, np.ones(2))
    assert found.best[0][1] > 0.5
    assert found.best[1][1] < 0.3
    gain, _ = discrepancy(grams, found, np.ones(2))
    assert gain == 0.0
    lin.residual = drawn(rng, lin, {0: (1.0, 5.0, 8 * HOUR), 1: (1.0, 0.0, HOUR)})
    grams = Grams(lin, observed)
    gain, colours = discrepancy(grams, estimated_colours(grams, np.ones(2)), np.ones(2))
    assert gain > 30
    assert colours[0][1] > 2 > colours[1][1]


@pytest.mark.parametrize("memory", [10.0, 40.0])
def test_a_slow_error_of_the_models_own_is_none_and_a_larger_one_is_a_discrepancy(memory):
    """What a model that is nearly right lacks must not be called a gap, nor take up one that is there."""
    rng = np.random.default_rng(8)

    def gains(size):
        made = []
        for _ in range(10):
            lin = problem_of(rng, steps=336, effects=1)
            slow = np.linalg.cholesky(covariance_of((1e-6, size, memory * HOUR), lin.problem.time))
            lin.residual = rng.standard_normal((2, 336)) + rng.standard_normal((2, 336)) @ slow.T
            grams = Grams(lin, seen(lin))
            made.append(discrepancy(grams, estimated_colours(grams, np.ones(2)), np.ones(2))[0])
        return np.array(made)

    assert np.mean(gains(FLOORS[0]) > STRONG) <= 0.1
    assert np.mean(gains(1.5) > STRONG) >= 0.8
