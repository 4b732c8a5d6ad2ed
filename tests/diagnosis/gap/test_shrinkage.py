"""Intervals of the share that is gone, over days that can be drawn alone."""

import numpy as np

from diagnosis.gap.shrinkage import _bootstrap
from diagnosis.recording import HOUR


def test_days_without_a_gap_that_are_drawn_alone_do_not_blow_the_interval_up():
    gap = np.repeat([1.0, 0.0, 0.0, 0.0], 24)  # a fifth of the draws has nothing of the first day
    old, new = 1.2 + 8.0 * gap, 1.3 + 0.7 * gap  # noise alone leaves 1.2
    shares = _bootstrap(old, new, np.ones(96, dtype=bool), (1.2, 0.5), HOUR, np.random.default_rng(4))
    # what the other days lost, 0.1, is held against the least gap, 0.5; of the first day's gap nine tenths are gone
    np.testing.assert_allclose([shares.min(), shares.max()], [-0.2, 0.9], atol=0.01)


def test_all_days_alike_give_the_same_share_however_drawn():
    old, new = np.full(96, 5.0), np.full(96, 2.0)
    shares = _bootstrap(old, new, np.ones(96, dtype=bool), (1.0, 0.5), HOUR, np.random.default_rng(1))
    np.testing.assert_allclose(shares, 0.75)
