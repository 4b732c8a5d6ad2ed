"""Percentiles of resamples of rooms, which some benchmarks print."""

import numpy as np
import pytest

from shared.metrics import r2
from tests.benchmarks.resampling import bootstrap_by_system


def test_interval_resamples_systems_not_windows():
    rng = np.random.default_rng(1)
    systems = np.repeat(np.arange(30), 100)
    level = rng.normal(size=30)[systems]
    low, high = bootstrap_by_system(systems, lambda rows: np.array(level[rows].mean()), draws=2000)
    # 100 copies of each system carry no more than one: the interval is that of 30 values
    sd = level[::100].std() / np.sqrt(30)
    assert (high - low) == pytest.approx(2 * 1.645 * sd, rel=0.05)


@pytest.mark.parametrize(("count", "known"), [(1, False), (3, False), (8, True)])
def test_of_few_systems_there_is_no_interval(count, known):
    """Resamples of one system alone have no R2; leaving them out would narrow the interval to the estimate itself."""
    rng = np.random.default_rng(2)
    systems = np.repeat(np.arange(count), 20)
    truth = rng.uniform(0.1, 0.7, size=count)[systems][:, None]
    estimate = truth + rng.normal(0, 0.1, size=truth.shape)
    low, high = bootstrap_by_system(systems, lambda rows: r2(truth[rows], estimate[rows]))
    assert np.isfinite([low, high]).all() == known
    assert not known or low[0] < r2(truth, estimate)[0] < high[0]
