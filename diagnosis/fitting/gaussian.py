"""Factors of the precision of Gaussian unknowns, also where rounding has spoilt the matrix.

A product of columns cannot have negative squares, but one of columns a million times as long as the unknowns' prior has
lost the one that is added to it, and a sum of such products may come out as singular or worse.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cholesky, eigh
from scipy.special import log_ndtr


def factor(gram: np.ndarray) -> np.ndarray:
    """Lower triangular L with L L' = 1 + ``gram``, shape (n, n); ``gram`` is that of some columns, but for rounding.

    Raises
    ------
    ValueError
        If the matrix is not finite.
    """
    try:
        return np.asarray(cholesky(np.eye(len(gram)) + gram, lower=True))
    except LinAlgError:
        return triangle(np.vstack([_columns(gram), np.eye(len(gram))]))


def root(covariance: np.ndarray) -> np.ndarray:
    """R with R R' = ``covariance``, shape (n, n), which rounding or a variance of zero may have made singular."""
    try:
        return np.asarray(cholesky(covariance, lower=True))
    except LinAlgError:
        return _columns(covariance).T


def triangle(rows: np.ndarray) -> np.ndarray:
    """Lower triangular L with L L' = rows' rows, shape (n, n), without that product; rows (m, n), m >= n."""
    upper = np.asarray(np.linalg.qr(rows, mode="r"))
    return np.asarray((upper * np.where(np.diag(upper) < 0, -1.0, 1.0)[:, None]).T)


def no_less_than_nothing(gram: np.ndarray) -> np.ndarray:
    """A product of columns (n, n) of which rounding has made some squares negative: those are zero."""
    try:
        cholesky(np.eye(len(gram)) + gram, lower=True)
    except LinAlgError:
        columns = _columns(gram)
        return np.asarray(columns.T @ columns)
    return gram


def _columns(gram: np.ndarray) -> np.ndarray:
    """Columns (n, n) that have these products.

    Each is brought to the length one first: beside a long column the rounding of a short one is all that there is.
    """
    size = np.sqrt(np.maximum(np.diag(gram), 0.0))
    size[size == 0] = 1.0
    values, vectors = eigh(gram / np.outer(size, size))
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * size)


def mass(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Log of what a standard normal holds between two bounds, low < high, of one shape; exact far out as well."""
    # the tail that is asked for is the lower one: there the logarithm loses no digits
    upper = low > 0
    low, high = np.where(upper, -high, low), np.where(upper, -low, high)
    most = log_ndtr(high)
    return np.asarray(most + np.log(-np.expm1(log_ndtr(low) - most)))
