"""How far below zero noise alone takes the readings of a meter whose quantity is never negative."""

from __future__ import annotations

import numpy as np

FEW = 5
"""So many readings below zero at least are noise; fewer may be anything."""
BEYOND = 5.0
"""Noise of so many standard deviations does not happen."""
_MIDDLE = 0.6745
"""The median of the size of a normal variable over its standard deviation, and 0.75 quantile of the same."""
_UPPER = 1.1503


def reach_of_noise(values: np.ndarray) -> float:
    """How far below zero readings (n,) in the order of time may be by noise, same unit; 0 if what is there is none.

    Noise around a small flow goes below zero as it goes above: its readings there crowd near zero, are no larger than
    the largest above it, and differ no more from zero than readings differ from the one before. The two estimates of
    its standard deviation are those of a normal variable: from the median of the readings below zero, and from
    the upper quartile of the differences. Readings below zero that are all far from it, a flow that is read with the
    wrong sign, are no noise.
    """
    below = -values[values < 0]
    if len(below) < FEW:
        return 0.0
    middle = float(np.median(below))
    differences = float(np.quantile(np.abs(np.diff(values)), 0.75)) / (_UPPER * np.sqrt(2))
    reach = min(BEYOND * middle / _MIDDLE, BEYOND * differences, float(values.max()))
    return reach if reach >= 2 * middle * (1 - 1e-9) else 0.0
