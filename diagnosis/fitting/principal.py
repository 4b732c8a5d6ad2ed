"""Principal directions of columns: where many unknowns move few readings, most of their directions move nothing."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh


def principal(columns: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thin singular value decomposition of columns (rows, n), from the smaller of its two products.

    Parameters
    ----------
    least
        Squared length from which a direction is kept.

    Returns
    -------
    tuple
        Squared lengths (k,), increasing, directions among the columns (n, k) and among the rows (rows, k), both
        orthonormal.
    """
    rows, count = columns.shape
    if not columns.size:
        return np.empty(0), np.empty((count, 0)), np.empty((rows, 0))
    wide = count > rows
    # all vectors are asked for, which divide and conquer gives fastest
    values, vectors = eigh(columns @ columns.T if wide else columns.T @ columns, driver="evd")
    keep = values > least
    values, vectors = values[keep], vectors[:, keep]
    scaled = vectors / np.sqrt(values)
    return (values, columns.T @ scaled, vectors) if wide else (values, vectors, columns @ scaled)
