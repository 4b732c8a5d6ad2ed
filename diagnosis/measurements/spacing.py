"""How far apart the readings of a column are, and for how long one of them therefore holds."""

from __future__ import annotations

import numpy as np

DAY = 86400.0
"""A state that is logged when it changes holds no longer than this [s]."""
MANY = 24
"""So many intervals tell a usual one from chance though stamps are late and readings lost."""
_LOOSE, _MOST = 0.5, 0.75
"""Of many intervals this share differs from the usual one by less than that share of it; of few by"""
_TIGHT, _ALL = 0.1, 0.9
EVIDENT, HARDLY = 5.0, 0.2
"""Repeats to be expected at least, of a column that is read all the time, and the share of them that one which is
logged when it changes may have: what is written anew when the logger starts."""
OFTEN = 0.1
"""Share of readings that repeat the one before, from which on they are written though nothing changes."""


def usual_interval(time: np.ndarray, there: np.ndarray) -> float:
    """The median spacing of readings [s]; of the file's rows where there are fewer than two readings."""
    spacing = np.diff(time[there]) if there.sum() > 1 else np.diff(time)
    return float(np.median(spacing))


def usual_gap(usual: float) -> float:
    """How far apart readings may be by default [s] that are usually so far apart [s].

    One lost reading of a close series is bridged, and stamps may be late. But a straight line over more than an hour
    invents a reading: of an hourly series a lost one is lost, and of an output any (:func:`.resampling.as_read`).
    """
    return min(2.5 * usual, max(1.5 * usual, 3600.0))


def usual_hold(time: np.ndarray, readings: np.ndarray) -> float:
    """How long a state holds by default [s].

    That of a column which is read all the time holds no longer than any other reading. That of one which is logged
    when it changes holds until the next, for :data:`DAY` at most. Two things tell them apart: a log of changes hardly
    ever repeats itself, where a column that is read all the time would; and what is read all the time has a usual
    interval, of its readings, or of the rows if most of its cells are filled, however much late stamps and lost
    readings blur it. A column that repeats itself at no usual interval, because its logger writes changes and now and
    then what has not changed, holds for as long as unchanged values usually take to be written again.

    Parameters
    ----------
    time, readings
        Stamps of the rows [s], and what was read, NaN where there is none; both (rows,).
    """
    there = np.isfinite(readings)
    apart, rows, values = np.diff(time[there]), np.diff(time), readings[there]
    if len(apart) < 2 or logged_on_change(values):
        return DAY
    gap = usual_gap(usual_interval(time, there))
    mostly_filled = np.mean(apart < 1.5 * np.median(rows)) >= 0.5
    if even(apart) or (even(rows) and mostly_filled):
        return gap
    same = np.diff(values) == 0
    if same.mean() < max(OFTEN, _by_chance(values)):
        return DAY
    return min(DAY, max(gap, usual_gap(float(np.quantile(apart[same], 0.9)))))


def even(spacing: np.ndarray) -> bool:
    """Whether most of the intervals (n,) [s] are near a usual one."""
    if len(spacing) < 2:
        return False
    tolerance, share = (_LOOSE, _MOST) if len(spacing) >= MANY else (_TIGHT, _ALL)
    usual = float(np.median(spacing))
    return float(np.mean(np.abs(spacing - usual) <= tolerance * usual)) >= share


def logged_on_change(values: np.ndarray) -> bool:
    """Whether readings (n,) repeat themselves so seldom that they are written only when they change.

    Of readings at times that have nothing to do with their values, at least so many repeat the one before as if they
    had been shuffled; and of those with a finest step about as many as move by it in one direction. Readings that are
    all different tell nothing.
    """
    levels = np.unique(values)
    if len(levels) < 2:
        return False
    change = np.abs(np.diff(values))
    finest = float(np.diff(levels).min())
    nearest = int(((change > 0) & (change < 1.5 * finest)).sum())
    expected = max(_by_chance(values) * len(change), 0.5 * nearest)
    return bool(expected >= EVIDENT and (change == 0).sum() <= HARDLY * expected)


def _by_chance(values: np.ndarray) -> float:
    """The share of readings (n,) that would repeat the one before if they were shuffled."""
    _, count = np.unique(values, return_counts=True)
    return float(np.sum((count / len(values)) ** 2))
