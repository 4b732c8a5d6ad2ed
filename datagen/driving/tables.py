"""Input signals and the table of all inputs that the integrator reads.

A signal is either linear between its points or holds its previous value. All signals of a system are merged on
one grid of knots; between two knots every input is a straight line, so that evaluation, means and integration
are exact and a jump can only be at a knot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

SNAP = 1e-6
"""Times closer than this are one knot [s]: far below any step, far above the rounding of a year in seconds."""


@dataclass(frozen=True, eq=False)
class Piecewise:
    """A signal over time, constant before its first and after its last point.

    Attributes
    ----------
    times
        Strictly increasing, shape (n,), n >= 1 [s].
    values
        Value at (``linear``) or from (``previous``) each time on, shape (n,) [unit of the signal].
    kind
        ``linear``: straight lines between the points; ``previous``: steps at the times, right-continuous.

    Raises
    ------
    ValueError
        If the arrays do not fit each other, are not finite, or times do not increase.
    """

    times: np.ndarray
    values: np.ndarray
    kind: Literal["linear", "previous"] = "linear"

    def __post_init__(self) -> None:
        times = np.ascontiguousarray(self.times, dtype=np.float64)
        values = np.ascontiguousarray(self.values, dtype=np.float64)
        if self.kind not in ("linear", "previous"):
            raise ValueError(f"kind is {self.kind!r}; expected 'linear' or 'previous'")
        if times.ndim != 1 or times.shape != values.shape or not times.size:
            raise ValueError(
                f"times have shape {times.shape}, values {values.shape}; expected two equal lengths of at least 1"
            )
        if not (np.isfinite(times).all() and np.isfinite(values).all()):
            raise ValueError("times or values are not finite")
        if (np.diff(times) <= 0).any():
            raise ValueError("times do not strictly increase")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    @classmethod
    def constant(cls, value: float) -> Piecewise:
        """A signal of one value."""
        return cls(np.zeros(1), np.array([value]), "previous")

    def at(self, t: ArrayLike) -> np.ndarray:
        """Values at times ``t`` [s], same shape as ``t``; right-continuous."""
        t = np.asarray(t, dtype=np.float64)
        if self.kind == "linear":
            return np.interp(t, self.times, self.values)
        return self.values[np.maximum(np.searchsorted(self.times, t, side="right") - 1, 0)]


@dataclass(frozen=True, eq=False)
class InputTable:
    """All inputs of a system on one grid of knots; see the module. Build one with :func:`merge`.

    Attributes
    ----------
    names
        Names of the inputs, in the order of the columns.
    time
        Knots, strictly increasing, shape (K,), K >= 2 [s].
    left, right
        Inputs at the start (right-hand limit) and at the end (left-hand limit) of each segment between two
        knots, shape (K - 1, inputs) [unit of each input]. float64, C-contiguous.
    jump
        Whether any input is discontinuous at a knot, shape (K,). False at both ends: the table knows one side only.
    """

    names: tuple[str, ...]
    time: np.ndarray
    left: np.ndarray
    right: np.ndarray
    jump: np.ndarray

    @property
    def start(self) -> float:
        """First knot [s]."""
        return float(self.time[0])

    @property
    def stop(self) -> float:
        """Last knot [s]."""
        return float(self.time[-1])

    def at(self, t: ArrayLike) -> np.ndarray:
        """Inputs at times ``t`` [s], shape (len(t), inputs): right-continuous, constant beyond the ends.

        At the last knot this is the limit from the left.
        """
        t = np.atleast_1d(np.asarray(t, dtype=np.float64))
        k = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, len(self.time) - 2)
        return self._value(k, t)

    def means(self, edges: ArrayLike) -> np.ndarray:
        """Exact mean of each input over each interval between ``edges`` [s].

        Parameters
        ----------
        edges
            Strictly increasing, within the table, shape (n + 1,) [s].

        Returns
        -------
        numpy.ndarray
            Shape (n, inputs) [unit of each input].

        Raises
        ------
        ValueError
            If the edges do not increase or leave the table.
        """
        edges = np.asarray(edges, dtype=np.float64)
        if edges.ndim != 1 or edges.size < 2 or (np.diff(edges) <= 0).any():
            raise ValueError("edges of intervals must be at least two and strictly increase")
        self._inside(edges[0], edges[-1])
        # Split segments at the edges: sums stay within one interval, so that nothing cancels over a long record.
        inside = self.time[(self.time > edges[0]) & (self.time < edges[-1])]
        points = np.unique(np.concatenate([inside, edges]))
        a, b = points[:-1], points[1:]
        k = np.clip(np.searchsorted(self.time, a, side="right") - 1, 0, len(self.time) - 2)
        areas = (0.5 * (b - a))[:, None] * (self._value(k, a) + self._value(k, b))
        sums = np.add.reduceat(areas, np.searchsorted(points, edges[:-1]), axis=0)
        return sums / np.diff(edges)[:, None]

    def restricted(self, start: float, stop: float) -> InputTable:
        """The table between ``start`` and ``stop`` [s].

        Raises
        ------
        ValueError
            If the span is empty or leaves the table.
        """
        if not start < stop:
            raise ValueError(f"span is {start:g} to {stop:g} s; expected start < stop")
        self._inside(start, stop)
        first = max(int(np.searchsorted(self.time, start + SNAP, side="right")), 1)
        last = max(int(np.searchsorted(self.time, stop - SNAP, side="left")), first)
        time, left, right = self.time[first - 1 : last + 1], self.left[first - 1 : last], self.right[first - 1 : last]
        if time[0] != start or time[-1] != stop:  # else the rows are those of this table
            time, left, right = np.concatenate([[start], time[1:-1], [stop]]), left.copy(), right.copy()
            left[0] = self._value(np.array([first - 1]), np.array([start]))[0]
            right[-1] = self._value(np.array([last - 1]), np.array([stop]))[0]
        jump = np.concatenate([[False], self.jump[first:last], [False]])
        return InputTable(self.names, time, left, right, jump)

    def refined(self, times: ArrayLike) -> InputTable:
        """The same inputs with further knots at ``times`` [s] (those within the table)."""
        extra = np.asarray(times, dtype=np.float64)
        extra = extra[(extra > self.start + SNAP) & (extra < self.stop - SNAP)]
        near = np.searchsorted(self.time, extra)
        extra = extra[(self.time[near] - extra > SNAP) & (extra - self.time[near - 1] > SNAP)]
        time = np.union1d(self.time, extra)
        k = np.searchsorted(self.time, time[:-1], side="right") - 1
        jump = np.zeros(len(time), dtype=bool)
        jump[np.searchsorted(time, self.time)] = self.jump
        return InputTable(self.names, time, self._value(k, time[:-1]), self._value(k, time[1:]), jump)

    def with_pulse(self, column: int, begin: float, end: float, height: float) -> InputTable:
        """The same inputs with one of them raised by ``height`` from ``begin`` to ``end`` [s], which must be knots.

        Raises
        ------
        ValueError
            If one of the two is not a knot.
        """
        first, last = (int(np.argmin(np.abs(self.time - t))) for t in (begin, end))
        if abs(self.time[first] - begin) > SNAP or abs(self.time[last] - end) > SNAP:
            raise ValueError(f"{begin:g} or {end:g} s is not a knot; refine the table first")
        left, right, jump = self.left.copy(), self.right.copy(), self.jump.copy()
        left[first:last, column] += height
        right[first:last, column] += height
        jump[first], jump[last] = first > 0, last < len(self.time) - 1
        return InputTable(self.names, self.time, left, right, jump)

    def _value(self, k: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Inputs at times ``t`` on the straight lines of segments ``k``, shape (len(t), inputs)."""
        start = self.time[k]
        share = np.clip((t - start) / (self.time[k + 1] - start), 0.0, 1.0)[:, None]
        left, right = self.left[k], self.right[k]
        # left + 0 where the two ends are equal: a constant stays that constant to the last bit
        return np.where(share < 1.0, left + share * (right - left), right)

    def _inside(self, start: float, stop: float) -> None:
        if start < self.start - SNAP or stop > self.stop + SNAP:
            raise ValueError(f"{start:g} to {stop:g} s is not within the inputs, {self.start:g} to {self.stop:g} s")


def merge(signals: Mapping[str, Piecewise], start: float, stop: float) -> InputTable:
    """Merge signals into one table over ``start`` to ``stop`` [s].

    Knots are the points of the linear signals and the times at which a held value really changes. Points closer
    than :data:`SNAP` become one knot.

    Raises
    ------
    ValueError
        If the span is empty or not finite.
    """
    if not (np.isfinite(start) and np.isfinite(stop) and stop - start > SNAP):
        raise ValueError(f"span is {start:g} to {stop:g} s; expected start < stop")
    effective = {name: _effective(signal) for name, signal in signals.items()}
    time = _knots(list(effective.values()), start, stop)
    segments = len(time) - 1
    left = np.empty((segments, len(signals)))
    right = np.empty((segments, len(signals)))
    jump = np.zeros(segments + 1, dtype=bool)
    for i, signal in enumerate(effective.values()):
        if signal.kind == "linear":
            values = np.interp(time, signal.times, signal.values)
            left[:, i], right[:, i] = values[:-1], values[1:]
        else:
            # the knot of each change: the last one not after it, where a knot up to SNAP later is the same knot
            knot = np.searchsorted(time, signal.times[1:] + SNAP, side="right") - 1
            column = signal.values[np.searchsorted(knot, np.arange(segments), side="right")]
            left[:, i] = right[:, i] = column
            jump[1:-1] |= column[1:] != column[:-1]
    return InputTable(tuple(signals), time, left, right, jump)


def _effective(signal: Piecewise) -> Piecewise:
    """Without the points at which a held value does not change; the first stays, as the value before all changes."""
    if len(signal.times) == 1 or (signal.kind == "linear" and (signal.values == signal.values[0]).all()):
        return Piecewise(signal.times[:1], signal.values[:1], "previous")
    if signal.kind == "linear":
        return signal
    keep = np.concatenate([[True], np.diff(signal.values) != 0])
    return Piecewise(signal.times[keep], signal.values[keep], "previous")


def _knots(signals: list[Piecewise], start: float, stop: float) -> np.ndarray:
    """All points of the signals within the span, and its ends, shape (K,) [s]."""
    # the first point of a held signal is no change, since the signal is constant before it
    parts: list[np.ndarray] = []
    for signal in signals:
        times = signal.times if signal.kind == "linear" else signal.times[1:]
        if not any(np.array_equal(times, part) for part in parts):
            parts.append(times)
    times = np.sort(np.concatenate([np.empty(0), *parts]), kind="stable")  # fast on runs that are sorted already
    times = times[(times > start + SNAP) & (times < stop - SNAP)]
    times = times[np.diff(times, prepend=start) > SNAP]
    return np.concatenate([[start], times, [stop]])


def followed(values: np.ndarray, keep: float, before: float = 0.0) -> np.ndarray:
    """What follows values with a memory: each is its value and ``keep`` of the one before it, shape (n,).

    A first-order recursive filter, y[k] = x[k] + keep y[k - 1]. To load scipy.signal takes every process longer.

    Parameters
    ----------
    before
        The one before the first.

    Examples
    --------
    >>> followed(np.array([1.0, 0.0, 0.0]), 0.5).tolist()
    [1.0, 0.5, 0.25]
    """
    following = accumulate(values.tolist(), lambda last, value: value + keep * last, initial=before)
    return np.fromiter(following, dtype=float, count=len(values) + 1)[1:]
