"""Co-Simulation: the FMU brings its own solver and is taken from communication point to communication point.

Communication points are equally spaced, and at most :data:`LONGEST_STEP` apart; where the FMU can handle steps of
varying size, there is one at each jump of the inputs and at each output too, so that both are met exactly.

Inputs that are linear in time: an FMU of FMI 2.0 that can interpolate gets their value and slope at each point; any
other gets, for the step, their exact mean over it, which keeps what they bring in. Discrete inputs get their value at
the point.

Means over the output step are trapezoids over the communication points, of which there are then at least
:data:`STEPS_FOR_A_MEAN` in an output step: outputs just after one point and just before the next.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from datagen.driving.tables import SNAP, InputTable
from datagen.fmi.calls import (
    DONE,
    EXPIRED,
    FMU_FAILED,
    N_INPUTS,
    N_MEANS,
    N_POINTS,
    NOT_FINITE,
    SET_SLOPES,
    TIMED_OUT,
    VR_INPUTS,
    VR_MEANS,
    VR_POINTS,
    do_step,
    get_floats,
    set_floats,
    set_slopes,
)
from datagen.fmi.compilation import njit

LONGEST_STEP = 300.0
"""Longest communication step [s]; also at most the FMU's own default step, where that is not very small."""
STEPS_FOR_A_MEAN = 12
"""Communication steps in an output step, at least, where an output is a mean."""
MOST_STEPS = 1000
"""Communication steps in an output step that an FMU's own small default step can ask for."""


class Steps(NamedTuple):
    """The communication steps of one simulation and the inputs of each, discrete inputs last.

    ``time`` (n,) and ``size`` (n,) [s]; ``before`` (n, inputs) at a step's start, ``held`` during it, ``slope`` then
    [1/s], ``after`` at its end; ``fresh`` (n,) whether inputs jump at a step's start; ``row`` (n,) the output to record
    at its end, or -1.
    """

    time: np.ndarray
    size: np.ndarray
    before: np.ndarray
    held: np.ndarray
    slope: np.ndarray
    after: np.ndarray
    fresh: np.ndarray
    row: np.ndarray


def longest_step(output_step: float, own: float | None, internal: float | None, *, means: bool) -> float:
    """The communication step [s]: divides the output step, and is a multiple of the FMU's internal step, if it has one.

    Parameters
    ----------
    own
        Step size of the FMU's default experiment, if it names one.
    internal
        Fixed internal step of the FMU, if it names one.
    means
        Whether an output is a mean.
    """
    limit = min(LONGEST_STEP, output_step / STEPS_FOR_A_MEAN if means else output_step)
    if own is not None and own > 0:
        limit = min(limit, max(own, output_step / MOST_STEPS))
    parts = max(1, int(np.ceil(output_step / limit - 1e-9)))
    if internal is not None and internal > 0:
        whole = round(output_step / internal)  # internal steps in an output step
        if whole >= 1 and abs(whole * internal - output_step) <= SNAP:
            parts = next((n for n in range(parts, whole + 1) if whole % n == 0), whole)
    return output_step / parts


def plan_steps(
    table: InputTable, grid: np.ndarray, longest: float, *, variable: bool, slopes: bool, n_continuous: int
) -> Steps:
    """Lay out the communication steps from the table's start to the last output.

    Parameters
    ----------
    grid
        Times of the outputs [s], the first one not before the table's start.
    variable
        Whether the FMU can handle steps of varying size.
    slopes
        Whether the FMU takes the time derivatives of its continuous inputs.

    Raises
    ------
    ValueError
        If the FMU wants equal steps and these do not meet the outputs.
    """
    start, stop = table.start, float(grid[-1])
    count = max(1, round((stop - start) / longest))
    if abs(start + count * longest - stop) > SNAP * max(count, 1):
        count = int(np.ceil((stop - start) / longest))
    points = start + longest * np.arange(count + 1)
    jumps = table.time[table.jump]
    if variable:
        # of times that are one, a jump counts before an output: just before it inputs are not yet what they become
        points = _joined(points[:1], jumps[jumps < stop], grid, points[points < stop])
        size = np.diff(points)
    else:
        size = np.full(count, longest)
    nearest = np.clip(np.searchsorted(points, grid), 1, len(points) - 1)
    nearest -= grid - points[nearest - 1] < points[nearest] - grid
    if np.abs(points[nearest] - grid).max() > SNAP or (np.diff(nearest) < 1).any():
        raise ValueError(f"equal communication steps of {longest:g} s from {start:g} s on do not meet the outputs")
    row = np.full(len(points), -1, dtype=np.int64)
    row[nearest] = np.arange(len(grid))
    points[-1] = min(points[-1], table.stop)
    inputs_of = _snapped(points, jumps)
    before = table.at(inputs_of[:-1])
    after = _limits_from_the_left(table, inputs_of[1:])
    slope = np.zeros_like(before)
    held = before.copy()
    k = slice(0, n_continuous)
    if before.size and n_continuous:
        if slopes:
            slope[:, k] = ((after - before) / size[:, None])[:, k]
        else:
            held[:, k] = table.means(inputs_of)[:, k]
    fresh = np.ones(len(before), dtype=bool)
    fresh[1:] = (before[1:] != after[:-1]).any(axis=1)
    return Steps(points[:-1].copy(), size, before, held, slope, after, fresh, row[1:].copy())


def _joined(*parts: np.ndarray) -> np.ndarray:
    """All times [s] of the parts, rising; of those within :data:`SNAP` of each other that of the earliest part."""
    found = parts[0]
    for part in parts[1:]:
        more = part[np.abs(_nearest(part, found) - part) > SNAP]
        found = np.unique(np.concatenate([found, more]))
    return found


def _snapped(points: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """``points`` [s], those that are jumps but for rounding at the very jumps: the sum of steps may fall short."""
    if not jumps.size:
        return points
    near = _nearest(points, jumps)
    return np.where(np.abs(near - points) <= SNAP, near, points)


def _nearest(times: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Of each of ``times`` [s] the nearest one ``among`` others, which rise and are at least one."""
    k = np.searchsorted(among, times)
    below, above = among[np.maximum(k - 1, 0)], among[np.minimum(k, len(among) - 1)]
    return np.where(np.abs(times - below) <= np.abs(above - times), below, above)


def _limits_from_the_left(table: InputTable, times: np.ndarray) -> np.ndarray:
    """Inputs just before ``times`` [s], shape (times, inputs)."""
    k = np.clip(np.searchsorted(table.time, times, side="left") - 1, 0, len(table.time) - 2)
    share = np.clip((times - table.time[k]) / (table.time[k + 1] - table.time[k]), 0.0, 1.0)[:, None]
    return np.where(share < 1.0, table.left[k] + share * (table.right[k] - table.left[k]), table.right[k])


@njit
def _put(plan: Any, row: Any, known: Any) -> bool:
    """Set the inputs to those of a row, unless they have these values: many an FMU begins its solver anew each time."""
    for j in range(len(row)):
        if row[j] != known[j]:
            known[:] = row
            return set_floats(plan, plan[VR_INPUTS], len(row), row.ctypes.data)
    return True


@njit(nogil=True)
def march(
    plan: Any,
    time: Any,
    size: Any,
    before: Any,
    held: Any,
    slope: Any,
    after: Any,
    fresh: Any,
    row: Any,
    points: Any,
    quadratures: Any,
    reached: Any,
) -> int:
    """Take the FMU through all communication steps; arguments as in :class:`Steps`.

    Parameters
    ----------
    plan
        Shape (PLAN_SIZE,), int64; the FMU is in step mode at the first point.
    points, quadratures
        Filled where ``row`` says so; the first row of ``quadratures`` is zero where it does not.
    reached
        Shape (1,): on return, how far it came [s].

    Returns
    -------
    int
        DONE or another outcome of :mod:`datagen.fmi.calls`.
    """
    n, n_points, n_means = plan[N_INPUTS], plan[N_POINTS], plan[N_MEANS]
    a, b, total = np.zeros(n_means), np.zeros(n_means), np.zeros(n_means)
    orders = np.ones(max(n, 1), dtype=np.int32)
    known = np.full(n, np.nan)  # what the inputs were set to last; a NaN is like nothing
    quadratures[0, :] = 0.0
    for i in range(len(time)):
        reached[0] = time[i]
        if plan[EXPIRED] != 0:
            return TIMED_OUT
        if n_means > 0 and fresh[i]:
            if not _put(plan, before[i], known):
                return FMU_FAILED
            if not get_floats(plan, plan[VR_MEANS], n_means, a.ctypes.data):
                return FMU_FAILED
        else:
            a[:] = b
        if not _put(plan, held[i], known):
            return FMU_FAILED
        if plan[SET_SLOPES] != 0 and not set_slopes(plan, orders, slope.ctypes.data + 8 * n * i):
            return FMU_FAILED
        outcome = do_step(plan, time[i], size[i])
        if outcome != DONE:
            return outcome
        if plan[SET_SLOPES] != 0:
            known[:] = np.nan  # the FMU has moved them itself
        if (n_means > 0 or row[i] >= 0) and not _put(plan, after[i], known):
            return FMU_FAILED
        if not get_floats(plan, plan[VR_MEANS], n_means, b.ctypes.data):
            return FMU_FAILED
        for j in range(n_means):
            total[j] += 0.5 * size[i] * (a[j] + b[j])
        if row[i] >= 0:
            if not get_floats(plan, plan[VR_POINTS], n_points, points.ctypes.data + 8 * n_points * row[i]):
                return FMU_FAILED
            for j in range(n_points):
                if not np.isfinite(points[row[i], j]):
                    return NOT_FINITE
            for j in range(n_means):
                quadratures[row[i], j] = total[j]
                if not np.isfinite(total[j]):
                    return NOT_FINITE
    return DONE
