"""A meter's register: what it has counted, and the power between two readings of it."""

from __future__ import annotations

import numpy as np

POWERS = {
    "kWh": ("kW", 3600.0), "Wh": ("W", 3600.0), "MWh": ("MW", 3600.0),
    "J": ("W", 1.0), "kJ": ("kW", 1.0), "MJ": ("MW", 1.0), "GJ": ("GW", 1.0),
    "kBtu": ("kBtu/h", 3600.0),
}  # fmt: skip
"""The power that an energy within some seconds is, and the factor that goes with it [s]."""
FALLS = 0.01
"""Share of a register's steps that may fall: it is reset, or a reading is lost as zero."""
DIFFERENT = 24
"""Different readings at least of what is taken for a register: no power rises so often without a fall."""


def is_register(counts: np.ndarray) -> bool:
    """Whether readings (n,) hardly ever fall: a power would.

    >>> is_register(np.arange(100.0)), is_register(np.arange(100.0) % 24)
    (True, False)
    """
    falls = int((np.diff(counts) < 0).sum())
    return len(np.unique(counts)) >= DIFFERENT and falls <= max(FALLS * len(counts), 1)


def _lost(counts: np.ndarray) -> np.ndarray:
    """Which readings (n,) of a register are none: zeros after which it goes on from where it was."""
    zero = counts == 0
    some = np.flatnonzero(~zero)
    if not zero.any() or len(some) < 2:
        return np.zeros(len(counts), dtype=bool)
    after = np.searchsorted(some, np.flatnonzero(zero))
    lost = zero.copy()
    inside = (after > 0) & (after < len(some))
    before, then = counts[some[np.maximum(after - 1, 0)]], counts[some[np.minimum(after, len(some) - 1)]]
    lost[zero] = inside & (then >= before)
    return lost


def between(time: np.ndarray, counts: np.ndarray, longest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is counted in a second between readings of a register.

    Parameters
    ----------
    time, counts
        Stamps [s] in order, and readings, both (n,).
    longest
        Readings further apart [s] leave a gap.

    Returns
    -------
    tuple
        Begin and end of each interval [s], and the rate [unit of the count / s], (intervals,) each. It is below zero
        where the register was reset.

    >>> between(np.array([0.0, 60.0, 120.0]), np.array([5.0, 5.0, 11.0]), 90.0)[2]
    array([0. , 0.1])
    """
    keep = ~_lost(counts)
    time, counts = time[keep], counts[keep]
    apart = np.diff(time)
    near = (apart > 0) & (apart <= longest)
    return time[:-1][near], time[1:][near], np.diff(counts)[near] / apart[near]
