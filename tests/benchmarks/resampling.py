"""Percentiles of resamples of rooms: intervals before :mod:`trainer.intervals`, and those of differences still."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def bootstrap_by_system(
    systems: np.ndarray,
    statistic: Callable[[np.ndarray], np.ndarray],
    *,
    draws: int = 500,
    level: float = 0.9,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Percentile interval of a statistic under resampling of whole systems.

    Parameters
    ----------
    systems
        System of each window, shape (windows,).
    statistic
        Takes rows (indices of windows) and returns an array.

    Returns
    -------
    tuple
        Low and high ends of the interval, shaped like the statistic. NaN where the statistic has no value in more of
        the resamples than the interval leaves out at one end, as R2 has none where all windows are of one system.
    """
    rng = np.random.default_rng(seed)
    rows = [np.flatnonzero(systems == s) for s in np.unique(systems)]
    values = [
        statistic(np.concatenate([rows[i] for i in rng.integers(len(rows), size=len(rows))])) for _ in range(draws)
    ]
    tail = 100 * (1 - level) / 2
    found = np.asarray(values)
    known = 100 * np.isnan(found).mean(axis=0) <= tail
    low, high = np.nanpercentile(np.where(known, found, 0.0), [tail, 100 - tail], axis=0)
    return np.where(known, low, np.nan), np.where(known, high, np.nan)
