"""Intervals of R2 and of shares that respect systems, and hold what they say of few systems, too.

Windows of one system are not independent, so it is systems that are left out or counted, never windows.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import ndtri, stdtrit

from shared.metrics import r2, wilson

FEWEST = 4
"""Systems: of fewer there is no interval of R2."""
RIGHT = 1e-17
"""1 - R2 of an estimate that is right, in place of 0, so that it has a logarithm."""


def r2_with_mean(truth: np.ndarray, estimate: np.ndarray) -> np.ndarray:
    """R2 of each parameter, and last the mean of these, (parameters + 1,); both are (windows, parameters)."""
    each = r2(truth, estimate)
    return np.append(each, each.mean())


def r2_interval(
    systems: np.ndarray, statistic: Callable[[np.ndarray], np.ndarray], *, level: float = 0.9
) -> tuple[np.ndarray, np.ndarray]:
    """Interval of R2, or of means of R2, by leaving out one system after the other.

    This is the jackknife (Efron and Tibshirani, 1993, An Introduction to the Bootstrap, chapter 11) of log(1 - R2),
    with its bias taken off, and Student's t. Percentiles of resamples will not do: a resample has some systems twice,
    the truth varies less in it, and its R2 is too low by about as much as an interval of ten systems is wide. An end
    that the estimate would lie beyond is moved to the estimate.

    ``systems`` (windows,) is each window's; ``statistic`` takes rows (indices of windows) and returns an array of R2,
    or of means of R2. The ends have its shape: NaN where there are fewer than ``FEWEST`` systems, or where the
    statistic has no value without one of them.
    """
    found, codes = np.unique(systems, return_inverse=True)
    count, estimate = len(found), np.asarray(statistic(np.arange(len(systems))))
    if count < FEWEST:
        return np.full(estimate.shape, np.nan), np.full(estimate.shape, np.nan)
    without = _log_error(np.array([statistic(np.flatnonzero(codes != one)) for one in range(count)]))
    shift = (count - 1) * (_log_error(estimate) - without.mean(axis=0))
    middle, sd = _log_error(estimate) + shift, np.sqrt((count - 1) * without.var(axis=0))
    reach = stdtrit(count - 1, (1 + level) / 2) * sd
    return np.minimum(1 - np.exp(middle + reach), estimate), np.maximum(1 - np.exp(middle - reach), estimate)


def _log_error(values: np.ndarray) -> np.ndarray:
    logarithm: np.ndarray = np.log(np.maximum(1 - values, RIGHT))
    return logarithm


def share_interval(systems: np.ndarray, inside: np.ndarray, *, level: float = 0.9) -> tuple[np.ndarray, np.ndarray]:
    """Interval of shares of windows: Wilson's (1927) for as many independent windows as they are worth.

    That number is the share's variance over that of independent windows, at least the number of systems, less what few
    systems leave unknown of it (Korn and Graubard, 1998, Survey Methodology 24:193). So an interval has a width where
    all windows are inside, as those of ten systems often are where nine tenths should.

    ``systems`` (windows,) is each window's, and ``inside`` (windows, ...) from 0 to 1. The ends are (...), NaN of one
    system.
    """
    codes = np.unique(systems, return_inverse=True)[1]
    sizes = np.bincount(codes)
    share, count = inside.mean(axis=0), len(sizes)
    if count < 2:
        return np.full(share.shape, np.nan), np.full(share.shape, np.nan)
    apart = np.zeros((count, *share.shape))
    np.add.at(apart, codes, inside - share)
    variance = count / (count - 1) * np.sum(apart**2, axis=0) / len(inside) ** 2
    single = share * (1 - share)
    fewest = len(inside) ** 2 / np.sum(sizes**2)  # systems, if each had as many windows
    known = variance > 1e-12
    worth = np.where(known, np.maximum(single / np.where(known, variance, 1), fewest), fewest)
    z = ndtri((1 + level) / 2)
    worth = worth * (z / stdtrit(count - 1, (1 + level) / 2)) ** 2
    return wilson(share, worth, float(z))
