"""The paper's two figures of merit, and an interval for them that respects systems.

Windows of one system are not independent, so intervals resample systems, never windows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

ROUNDING = 1e-9
"""Numbers that differ by less, relative to their size, are the same."""


def r2(truth: np.ndarray, estimate: np.ndarray) -> np.ndarray:
    """Coefficient of determination of each parameter (paper, section 4.1), in the parameter's own unit.

    Parameters
    ----------
    truth, estimate
        Shape (windows, parameters).

    Returns
    -------
    numpy.ndarray
        Shape (parameters,). NaN where the truth does not vary.
    """
    residual = np.sum((truth - estimate) ** 2, axis=0)
    spread = np.sum((truth - truth.mean(axis=0)) ** 2, axis=0)
    # the mean of equal numbers is not quite that number, so that their spread is not quite zero
    varies = np.ptp(truth, axis=0) > ROUNDING * np.abs(truth).max(axis=0)
    return np.where(varies, 1 - residual / np.where(varies, spread, 1), np.nan)


def relative_accuracy(truth: np.ndarray, estimate: np.ndarray) -> np.ndarray:
    """1 - |p - p_hat| / p of each window and parameter (paper, equation 3); same shape as ``truth``."""
    return 1 - np.abs(truth - estimate) / truth


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
