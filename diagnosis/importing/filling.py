"""What becomes of gaps: outputs keep them; inputs, which a simulation needs at every step, have three ways.

A gap of an input is filled only as its mapping says (weather by straight lines over a few hours, unless told
otherwise; anything by a constant if told so), flagged and reported. What is still missing cuts the recording: the
longest stretch without is kept. An input that is wrong shows in the outputs for as long as the walls remember.
"""

from __future__ import annotations

import numpy as np

from shared.flags import ASSUMED, INTERPOLATED
from shared.gaps import bridge


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Stretches where a mask is true, as (first, one past the last)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def interpolate_short(values: np.ndarray, flags: np.ndarray, longest: int) -> tuple[np.ndarray, np.ndarray]:
    """Straight lines over inner gaps of at most ``longest`` steps; both (n,)."""
    values, flags = values.copy(), flags.copy()
    flags[bridge(values, longest)] |= INTERPOLATED
    return values, flags


def fill_constant(values: np.ndarray, flags: np.ndarray, value: float) -> tuple[np.ndarray, np.ndarray]:
    """One value in all gaps; both (n,)."""
    gap = ~np.isfinite(values)
    return np.where(gap, value, values), flags | np.where(gap, ASSUMED, 0).astype(np.int8)


def longest_whole(inputs: dict[str, np.ndarray], first: int, last: int) -> tuple[int, int]:
    """The longest stretch of steps within ``first`` to ``last`` (one past) in which every input has a value."""
    whole = np.ones(last - first, dtype=bool)
    for values in inputs.values():
        whole &= np.isfinite(values[first:last])
    found = runs(whole)
    if not found:
        return first, first
    a, b = max(found, key=lambda run: run[1] - run[0])
    return first + a, first + b
