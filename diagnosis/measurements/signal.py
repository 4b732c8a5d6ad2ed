"""Readings with their quality: what is impossible or stuck is marked and never used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from diagnosis.measurements import units
from diagnosis.measurements.mapping import Source
from diagnosis.measurements.register import between
from shared.codes import coded
from shared.errors import RecordingError
from shared.schema import IMPOSSIBLE, STUCK
from shared.still import Resting, elapsed, long_runs

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
    invents a reading: of an hourly series a lost one is lost, and of an output any (:func:`.grid.as_read`).
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


_SLACK = 1e-9
"""Rounding that a limit forgives, as a share of its size."""


@dataclass(frozen=True, eq=False)
class Signal:
    """Readings of one quantity, in the unit that the recording will have.

    Attributes
    ----------
    begin, end
        Interval of each reading, ordered and without overlap, shape (n,) [s]; equal for instants.
    values
        Shape (n,) [``unit``].
    flags
        Bits of :data:`shared.schema.FLAGS` of each reading, shape (n,); impossible or stuck ones are not used.
    kind
        ``point``: instants joined by straight lines; ``mean``: means of the intervals; ``hold``: states that hold.
    max_gap
        Readings further apart leave a gap [s].
    holds
        A state holds no longer than this [s].
    floor
        What is measured is not below this, though readings may be, by their noise [``unit``].
    """

    begin: np.ndarray
    end: np.ndarray
    values: np.ndarray
    flags: np.ndarray
    kind: Literal["point", "mean", "hold"]
    max_gap: float
    unit: str
    holds: float = np.inf
    floor: float = -np.inf

    @property
    def middle(self) -> np.ndarray:
        """Middle of each reading's interval, shape (n,) [s]."""
        return 0.5 * (self.begin + self.end)

    @property
    def used(self) -> np.ndarray:
        """Which readings may be used, shape (n,)."""
        return (self.flags & (IMPOSSIBLE | STUCK)) == 0

    def clean(self) -> Signal:
        """The readings that may be used."""
        k = self.used
        return replace(self, begin=self.begin[k], end=self.end[k], values=self.values[k], flags=self.flags[k])


def make_signal(
    time: np.ndarray,
    readings: np.ndarray,
    source: Source,
    target: str,
    *,
    kind: Literal["point", "mean", "hold", "register"],
    stamp: Literal["start", "end"],
    density: float,
    where: str,
) -> Signal:
    """Readings of a column as a signal in the target's unit; codes for missing ones are marked impossible.

    Of a register it is the power between readings, whose ``source`` is that of :meth:`.mapping.Source.as_power`.
    ``time`` [s] are stamps, ``readings`` numbers as read, NaN where there is none, both (rows,). Raises RecordingError
    if the units do not fit.
    """
    there = np.isfinite(readings)
    t = time[there] + source.shift
    values = to_target(readings[there], source, target, density=density, where=where)
    usual = usual_interval(time, there)
    max_gap = 3600.0 * source.max_gap if source.max_gap is not None else usual_gap(usual)
    # where the mapping says what is possible, it knows better
    nines = coded(readings[there]) if source.valid is None else np.zeros(len(t), dtype=bool)
    begin = end = t
    holds = np.inf
    if kind == "register":
        longest = max_gap if source.max_gap is not None else usual_hold(time, readings)
        begin, end, rates = between(t[~nines], readings[there][~nines], longest)
        values = to_target(rates, source, target, density=density, where=where)
        return Signal(begin, end, values, np.where(rates < 0, IMPOSSIBLE, 0).astype(np.int8), "mean", longest, target)
    if kind == "mean":
        length = source.interval if source.interval is not None else usual
        if stamp == "end":
            begin = np.maximum(t - length, np.concatenate([[-np.inf], t[:-1]]))
        else:
            end = np.minimum(t + length, np.concatenate([t[1:], [np.inf]]))
    elif kind == "hold":
        seen = readings.copy()
        seen[there] = np.where(nines, np.nan, readings[there])
        holds = max_gap if source.max_gap is not None else usual_hold(time, seen)
        # a log of changes is silent after its last one, though its logger writes the rows of others
        last = max(t[-1] + usual, time[-1] + source.shift) if t.size else 0.0
        end = np.minimum(t + holds, np.concatenate([t[1:], [last]])) if t.size else t
    flags = np.where(nines, IMPOSSIBLE, 0).astype(np.int8)
    return Signal(begin, end, values, flags, kind, max_gap, target, holds)


def to_target(readings: np.ndarray, source: Source, target: str, *, density: float, where: str) -> np.ndarray:
    """Numbers as read to the target's unit: ``scale * reading + offset`` in the declared unit, then converted.

    Raises RecordingError if the units do not fit, or a number becomes larger than a recording can hold.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        values = source.scale * readings + source.offset
        if source.persons is not None:
            values = values * source.persons
        values = units.convert(values, source.unit, target, density=density, where=where)
    beyond = ~(np.abs(values) <= units.LARGEST)
    if beyond.any():
        raise RecordingError(
            f"{where}: {readings[beyond].ravel()[0]:g} becomes {values[beyond].ravel()[0]:g} {target} with scale"
            f" {source.scale:g} and offset {source.offset:g}; expected at most {units.LARGEST:g}"
        )
    return values


def _possible(
    source: Source, unit: str, *, density: float, where: str, sun: bool, signed: bool
) -> tuple[float, float, units.Below, float]:
    """Lowest and highest possible value [unit], what is below zero, and how far beyond a limit is still rounding."""
    low, high, below = units.limits(source.unit, unit, sun=sun, density=density)
    if signed:
        low, high, below = -np.inf, np.inf, "impossible"
    if source.persons is not None:
        low, high = low * source.persons, high * source.persons
    if source.valid is not None:
        ends = units.convert(np.array(source.valid), source.unit, unit, density=density, where=where)
        ends = ends * (source.persons or 1.0)
        low, high, below = float(ends.min()), float(ends.max()), "impossible"
    elif (source.scale, source.offset) != (1.0, 0.0) and source.unit in units.WORD_LIMITS:
        low, high = -np.inf, np.inf  # the word's limits hold for what was read, not for what was made of it
    sizes = [abs(one) for one in (low, high) if np.isfinite(one)]
    return low, high, below, _SLACK * max(sizes, default=0.0)


def check_possible(
    value: float,
    source: Source,
    unit: str,
    *,
    density: float,
    where: str,
    sun: bool = True,
    signed: bool = False,
) -> None:
    """Refuse a constant that readings in its place would be refused for.

    Raises RecordingError if ``value`` [unit] is impossible.
    """
    low, high, _, slack = _possible(source, unit, density=density, where=where, sun=sun, signed=signed)
    if low - slack <= value <= high + slack:
        return
    raw = source_value(value, source, unit, density=density, where=where)
    fits = [one for one in units.alternatives(raw, unit, low, high, density=density) if one != source.unit]
    made = f", which is {value:.6g} {unit}" if source.unit != unit else ""
    ends = possible_in_source(source, unit, density=density, where=where, sun=sun, signed=signed)
    wider = [
        f"{one:.6g}" if np.isfinite(one) else word
        for one, word in zip((min(raw, ends[0]), max(raw, ends[1])), ("lowest", "highest"), strict=True)
    ]
    hint = f"; is it in {' or '.join(fits)}?" if fits else f", or valid = [{', '.join(wider)}] beside it if it is right"
    raise RecordingError(f"{where}: is {raw:.6g} {source.unit}{made}; expected {low:g} to {high:g} {unit}{hint}")


def mark_impossible(
    signal: Signal, source: Source, *, density: float, where: str, sun: bool = True, signed: bool = False
) -> Signal:
    """Mark readings outside the possible values.

    ``sun`` says that what is in W/m2 is irradiance, ``signed`` that readings are differences, which go either way.

    Of quantities that are never negative, small negative readings become zero if they are an offset or rounding. If
    they are a meter's noise they stay, as far down as its noise reaches: without them means would be too large. The
    signal then has a ``floor``. Raises RecordingError if more than half of the readings are impossible: then it is the
    unit, not the sensor.
    """
    low, high, below, slack = _possible(source, signal.unit, density=density, where=where, sun=sun, signed=signed)
    if below == "noise":
        low = min(low, -reach_of_noise(signal.values[signal.used]))
    bad = (signal.values < low - slack) | (signal.values > high + slack)
    if bad.sum() > 0.5 * len(bad):
        middle = float(np.median(signal.values))
        # what was read, as nearly as the conversion tells: the signal's own unit may hide the slip
        raw = source_value(middle, source, signal.unit, density=density, where=where)
        fits = [one for one in units.alternatives(raw, signal.unit, low, high, density=density) if one != source.unit]
        hint = f"; is it in {' or '.join(fits)}?" if fits else ""
        raise RecordingError(
            f"{where}: declared in {source.unit!r}, its median {raw:.4g} is {middle:.4g} {signal.unit}, and "
            f"{int(bad.sum())} of {len(bad)} readings lie outside {low:g} to {high:g} {signal.unit}{hint}; if they are"
            " right, valid = [lowest, highest] says what is possible"
        )
    values = signal.values
    if below == "zero" or (below == "impossible" and low == 0.0):  # the latter is rounding
        values = np.where((values < 0) & ~bad, 0.0, values)
    flags = signal.flags | np.where(bad, IMPOSSIBLE, 0).astype(np.int8)
    return replace(signal, values=values, flags=flags, floor=0.0 if below == "noise" else -np.inf)


def possible_in_source(
    source: Source, unit: str, *, density: float, where: str, sun: bool = True, signed: bool = False
) -> tuple[float, float]:
    """Lowest and highest possible value in the declared unit of a column: what ``valid`` says, or would say."""
    ends = [
        source_value(end, source, unit, density=density, where=where) if np.isfinite(end) else end
        for end in _possible(source, unit, density=density, where=where, sun=sun, signed=signed)[:2]
    ]
    each = source.persons or 1.0
    return min(ends) / each, max(ends) / each


def source_value(value: float, source: Source, unit: str, *, density: float, where: str) -> float:
    """A value of a signal back in the declared unit of its column."""
    return float(units.convert(value, unit, source.unit, density=density, where=where))


def mark_stuck(
    signal: Signal,
    hours: float,
    *,
    zero: float | None = None,
    lasting: Callable[[np.ndarray, np.ndarray], np.ndarray] = elapsed,
) -> Signal:
    """Mark runs of equal readings that last longer than ``hours`` [h], zeros ``zero`` [h]; a gap ends a run.

    ``lasting`` is how long something lasts [s] from its begin to its end [s], of what does not always move: irradiance
    by day.
    """
    if hours <= 0 or len(signal.values) < 2:
        return signal
    joined = (np.diff(signal.middle) <= signal.max_gap) & signal.used[1:] & signal.used[:-1]
    resting = None if zero is None else Resting(0.0, zero)
    runs = long_runs(signal.values, signal.begin, signal.end, hours, resting, joined, lasting)
    flags = signal.flags.copy()
    for first, last in zip(runs.first, runs.last, strict=True):
        flags[first : last + 1] |= np.int8(STUCK)
    return replace(signal, flags=flags)


def is_constant(signal: Signal) -> bool:
    """Whether all usable readings are the same."""
    values = signal.values[signal.used]
    return len(values) > 1 and bool((values == values[0]).all())
