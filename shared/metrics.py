"""The paper's two figures of merit, and the interval of a share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

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
    """1 - |p - p_hat| / p of each window and parameter (paper, equation 3); same shape as ``truth``.

    Of a parameter that is not positive throughout, the error is divided by the mean of its size.
    """
    size = np.where((truth > 0).all(axis=0), truth, np.abs(truth).mean(axis=0))
    return 1 - np.abs(truth - estimate) / size


def wilson(share: ArrayLike, count: ArrayLike, z: float) -> tuple[np.ndarray, np.ndarray]:
    """Ends of an interval of shares of ``count`` independent draws, z standard normal deviates to either side.

    The score interval (Wilson 1927, J. Am. Stat. Assoc. 22:209): it has a width where the share is 0 or 1, too.
    ``share`` and ``count`` are of one shape, or broadcast; neither has to be a whole number of hits.
    """
    share, count = np.asarray(share, dtype=np.float64), np.asarray(count, dtype=np.float64)
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    reach = z / (1 + z**2 / count) * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2))
    # the ends are 0 and 1 where the share is, but for rounding
    return np.clip(middle - reach, 0, share), np.clip(middle + reach, share, 1)
