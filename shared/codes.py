"""What loggers write where a reading is missing."""

from __future__ import annotations

import numpy as np

CODES = np.array(
    [sign * code for sign in (-1, 1) for code in (99, 99.9, 999, 999.9, 9999, 9999.9, 99999)]
    + [-32768, 32767, 65535, -3276.8, 3276.7, 6553.5, -327.68, 327.67, 655.35]
    + [-2147483648, 2147483647, 4294967295, -40]
)
"""Minus or plus nines, the ends of what registers of 16 and 32 bits can hold, and a thermometer torn off."""
ENOUGH = 5
"""Different other readings that it takes to tell a code from a reading of a column that hardly ever changes."""
BELOW, ABOVE = 1.0, 5.0
"""So many spans of the other readings a code lies below or above them all: 999 ppm or 99 W/m2 may be readings.
Below zero it is one where nothing else is."""


ABSURD = 5.0
"""Where other readings are fewer than that, but at least two, a code is one that is so many times as large as any."""


def coded(readings: np.ndarray) -> np.ndarray:
    """Which readings of one column (n,) [any unit] are codes, far from all that are none."""
    code = np.isin(readings.astype(np.float32), CODES.astype(np.float32))  # in whichever precision they were written
    others = np.unique(readings[~code & np.isfinite(readings)])
    if not code.any() or len(others) < 2:
        return np.zeros(len(readings), dtype=bool)
    if len(others) < ENOUGH:
        return np.asarray(code & (np.abs(readings) > ABSURD * np.abs(others).max()))
    low, high = others[0], others[-1]
    floor = max(low - BELOW * (high - low), 0.0 if low >= 0 else -np.inf)
    far = (readings < floor) | (readings > high + ABOVE * (high - low))
    return np.asarray(code & far)
