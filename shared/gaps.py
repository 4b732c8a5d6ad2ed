"""Short gaps in a series, bridged by straight lines."""

from __future__ import annotations

import numpy as np


def bridge(values: np.ndarray, longest: int) -> np.ndarray:
    """Put in what is missing where at most so many values are missing in a row; nothing at the ends.

    ``values`` (steps,), NaN where missing, are changed in place. Returns where values were put in, (steps,).
    """
    missing = ~np.isfinite(values)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(np.int8)))
    filled = np.zeros(len(values), dtype=bool)
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        if first > 0 and after < len(values) and after - first <= longest:
            filled[first:after] = True
    if filled.any():
        values[filled] = np.interp(np.flatnonzero(filled), np.flatnonzero(~missing), values[~missing])
    return filled
