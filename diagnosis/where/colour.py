"""The colour of residuals: an autoregression fitted to recording and twins alike, and the filter that takes it out."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz

ORDER = 3


def fill(values: np.ndarray) -> np.ndarray:
    """Join what is there across gaps by straight lines, level at the ends; linear in the values; shape (..., steps)."""
    steps = np.arange(values.shape[-1])
    flat = values.reshape(-1, values.shape[-1]).copy()
    for row in flat:
        seen = np.isfinite(row)
        if not seen.all():
            row[~seen] = np.interp(steps[~seen], steps[seen], row[seen]) if seen.any() else 0.0
    return flat.reshape(values.shape)


def fit_colour(values: np.ndarray, order: int = ORDER) -> np.ndarray:
    """Coefficients of an autoregression by the Yule-Walker equations, pooled over rows (Box and Jenkins, section 3.2).

    Parameters
    ----------
    values
        Shape (rows, steps); NaN where missing: products of which a factor is missing are left out.

    Returns
    -------
    numpy.ndarray
        Shape (order,). All rows count alike, so that filtered rows stay exchangeable.
    """
    seen = np.isfinite(values)
    count = seen.sum(axis=1, keepdims=True)
    mean = np.where(seen, values, 0.0).sum(axis=1, keepdims=True) / np.maximum(count, 1)
    apart = np.where(seen, values - mean, 0.0)
    steps = values.shape[1]
    covariance = np.zeros(order + 1)
    for lag in range(order + 1):
        pairs = (seen[:, lag:] & seen[:, : steps - lag]).sum()
        # dividing by pairs at each lag and shrinking by the usual (steps - lag) / steps keeps the sequence definite
        covariance[lag] = np.sum(apart[:, lag:] * apart[:, : steps - lag]) / max(pairs, 1) * (steps - lag) / steps
    if covariance[0] <= 0:
        return np.zeros(order)
    covariance[0] *= 1 + 1e-6
    return np.asarray(solve_toeplitz(covariance[:-1], covariance[1:]))


def whiten(values: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """What the autoregression does not foresee; the first ``len(colour)`` steps are NaN; shape (..., steps)."""
    found = values.astype(float).copy()
    for lag, weight in enumerate(colour, start=1):
        found[..., lag:] -= weight * values[..., :-lag]
    found[..., : len(colour)] = np.nan
    return found
