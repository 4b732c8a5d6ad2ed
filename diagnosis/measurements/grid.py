"""From readings at any time to a regular grid: means stay means, instants stay instants.

Between readings nothing is invented: readings further apart than their signal's ``max_gap`` leave a gap, and those of
an output if one between them was lost. A reading that is a mean stands for the middle of its interval where an instant
is asked for: at the edge of two equal intervals this is the mean of the two, as for weather files.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from diagnosis.measurements.signal import Signal
from shared.schema import ASSUMED, IMPOSSIBLE, INTERPOLATED, MISSING, PARTLY, STUCK
from shared.stretches import bridge
from shared.variables import ExcitationInput, Input, Output, WeatherInput

IRRADIANCES = ("ghi", "dni", "dhi", "poa_global")
"""pvlib's names of what the sun does."""


@dataclass(frozen=True)
class Target:
    """What the system description wants: ``method`` is CF's, the mean of a step or the instant at its end.

    ``sun`` says that it is irradiance of the weather, which is never negative; ``signed`` that it is a difference, as
    an excitation is, which goes either way.
    """

    name: str
    role: Literal["output", "input"]
    unit: str
    method: Literal["mean", "point"]
    sun: bool = False
    signed: bool = False


def output_target(one: Output) -> Target:
    """What an output wants."""
    return Target(one.name, "output", one.unit, one.method)


def input_target(one: Input) -> Target:
    """What an input wants: held inputs the means of the steps, the others instants joined by straight lines."""
    sun = isinstance(one, WeatherInput) and one.column in IRRADIANCES
    method: Literal["mean", "point"] = "mean" if one.interpolation == "previous" else "point"
    return Target(one.name, "input", one.unit, method, sun, signed=isinstance(one, ExcitationInput))


@dataclass
class Series:
    """One variable on the grid.

    Attributes
    ----------
    values
        Shape (steps,) [unit of the target], NaN where there is none.
    flags
        Bits of :data:`shared.schema.FLAGS` without ``missing``, shape (steps,).
    origin
        Where it comes from, in a few words.
    comment
        The same at length, if there is more to say.
    signal
        The readings behind it, if there are any.
    key
        Where its column stands in the mapping, as ``weather.ghi``; empty where none does.
    second, second_name
        A second meter on the same grid, and its column.
    """

    target: Target
    origin: str
    values: np.ndarray
    flags: np.ndarray
    comment: str = ""
    signal: Signal | None = None
    key: str = ""
    second: np.ndarray | None = None
    second_name: str = ""

    def flagged(self) -> np.ndarray:
        """Flags with the bit of what is missing, (steps,)."""
        return (self.flags | np.where(np.isfinite(self.values), 0, MISSING)).astype(np.int8)

    def cut(self, first: int, last: int) -> None:
        """Keep the steps ``first`` to ``last`` (one past)."""
        self.values, self.flags = self.values[first:last], self.flags[first:last]
        self.second = None if self.second is None else self.second[first:last]


def interpolate_short(values: np.ndarray, flags: np.ndarray, longest: int) -> tuple[np.ndarray, np.ndarray]:
    """Straight lines over inner gaps of at most ``longest`` steps; both (n,)."""
    values, flags = values.copy(), flags.copy()
    flags[bridge(values, longest)] |= INTERPOLATED
    return values, flags


def fill_constant(values: np.ndarray, flags: np.ndarray, value: float) -> tuple[np.ndarray, np.ndarray]:
    """One value in all gaps; both (n,)."""
    gap = ~np.isfinite(values)
    return np.where(gap, value, values), flags | np.where(gap, ASSUMED, 0).astype(np.int8)


CLOSER = 0.75
"""Readings closer than this share of a step are averaged where an input is joined by straight lines."""
NEARLY = 0.9
"""Share of a step around an instant that readings must cover for their mean to be of its middle."""
LOST = 1.5
"""Readings of an output that are so many usual intervals apart, and so many steps, have lost one between them."""
_AT = 0.25
"""A reading nearer to an instant than this share of the usual interval, or of a step, was read there."""
_WHOLE = 1.0 - 1e-9
"""Share from which on a step counts as covered."""


def means_of(signal: Signal, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean of a signal over each of n steps, NaN where nothing covers it, and how much of it readings cover, in [0, 1].

    ``edges`` are of the steps, strictly increasing, shape (n + 1,) [s].
    """
    clean = signal.clean()
    span = np.diff(edges)
    if not len(clean.values):
        return np.full(len(span), np.nan), np.zeros(len(span))
    # about their own level, so that sums over a long record cancel nothing
    level = float(clean.values.mean())
    integral, covered = (_lines if clean.kind == "point" else _bins)(clean, clean.values - level, edges)
    share = np.clip(np.diff(covered) / span, 0.0, 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.where(share > 1e-9, level + np.diff(integral) / np.diff(covered), np.nan)
    # sums leave a little rounding, by which nobody would be a little somebody: the mean of zeros is zero
    low, high = float(clean.values.min()), float(clean.values.max())
    largest = max(abs(low), abs(high))
    if largest > 1e-200:  # below, there are no decimals to round to
        means = np.round(means, 12 - int(np.ceil(np.log10(largest))))
    means = np.clip(means, low, high)
    return means, share


def _bins(clean: Signal, values: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Integrals of values and of coverage up to each edge, of readings that hold over their intervals."""
    length = clean.end - clean.begin
    knots = np.stack([clean.begin, clean.end], axis=1).ravel()
    before = np.concatenate([[0.0], np.cumsum(values * length)])
    time = np.concatenate([[0.0], np.cumsum(length)])
    integral = np.stack([before[:-1], before[1:]], axis=1).ravel()
    covered = np.stack([time[:-1], time[1:]], axis=1).ravel()
    return np.interp(edges, knots, integral), np.interp(edges, knots, covered)


def _lines(clean: Signal, values: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of instants that are joined by straight lines where they are close enough."""
    t = clean.begin
    if len(t) < 2:
        return np.zeros(len(edges)), np.zeros(len(edges))
    length = np.diff(t)
    joined = length <= clean.max_gap * (1 + 1e-9)
    area = np.where(joined, 0.5 * (values[1:] + values[:-1]) * length, 0.0)
    before = np.concatenate([[0.0], np.cumsum(area)])
    time = np.concatenate([[0.0], np.cumsum(np.where(joined, length, 0.0))])
    at = np.clip(edges, t[0], t[-1])
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    into = np.where(joined[k], at - t[k], 0.0)
    slope = (values[k + 1] - values[k]) / length[k]
    # an edge within a gap, or at its end, has all that lies before it
    return before[k] + values[k] * into + 0.5 * slope * into**2, time[k] + into


def instants_of(signal: Signal, times: np.ndarray) -> np.ndarray:
    """Values of a signal at instants, NaN in gaps and outside, same shape as ``times`` [s]."""
    clean = signal.clean()
    n = len(clean.values)
    if not n:
        return np.full(len(times), np.nan)
    if clean.kind == "hold":
        k = np.searchsorted(clean.begin, times, side="right") - 1
        inside = (k >= 0) & (times <= clean.end[k])
        return np.where(inside, clean.values[k], np.nan)
    t = clean.middle
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, max(n - 2, 0))
    after = np.minimum(k + 1, n - 1)
    close = (t[after] - t[k] <= clean.max_gap * (1 + 1e-9)) & (times >= t[0]) & (times <= t[-1])
    exact = (times == t[k]) | (times == t[after])
    return np.where(close | exact, np.interp(times, t, clean.values), np.nan)


def values_at(signal: Signal, other: Signal) -> np.ndarray:
    """Values of a signal over the readings of another, NaN where it has none, shape (readings of the other,)."""
    if np.array_equal(signal.begin, other.begin) and np.array_equal(signal.end, other.end):
        return np.where(signal.used, signal.values, np.nan)
    if not (other.end > other.begin).all():
        return instants_of(signal, other.middle)
    edges = np.unique(np.concatenate([other.begin, other.end]))
    means, share = means_of(signal, edges)
    k = np.searchsorted(edges, other.begin)  # the readings do not overlap: each is one piece between two edges
    return np.where(share[k] >= NEARLY, means[k], np.nan)


def around(signal: Signal, edges: np.ndarray) -> np.ndarray:
    """Means over a step about each step's end (n,): what straight lines through them keep of closer readings.

    At instants alone, the sun between clouds at the full hour would stand for the hour. Where readings do not cover
    nearly all of it their value at the instant: half of a step has another middle.
    """
    step = float(edges[1] - edges[0])
    at = instants_of(signal, edges[1:])
    if len(signal.values) < 2 or float(np.median(np.diff(signal.middle))) > CLOSER * step:
        return at
    values, share = means_of(signal, np.append(edges[1:], edges[-1] + step) - 0.5 * step)
    return np.where(share >= NEARLY, values, at)


def resample(signal: Signal, edges: np.ndarray, method: str, coverage: float) -> tuple[np.ndarray, np.ndarray]:
    """A signal on the grid, NaN where it has no value, and its flags without ``missing``; both (n,).

    ``edges`` are of the steps, (n + 1,) [s]; ``method`` is ``mean`` over each step, or ``point`` at its end;
    ``coverage`` is the least share of a step that readings must cover for a mean.
    """
    flags = np.zeros(len(edges) - 1, dtype=np.int8)
    if method == "mean":
        values, share = means_of(signal, edges)
        values = np.where(share >= coverage * _WHOLE, values, np.nan)
        flags |= np.where(np.isfinite(values) & (share < _WHOLE), PARTLY, 0).astype(np.int8)
    else:
        values = instants_of(signal, edges[1:])
    for bit in (IMPOSSIBLE, STUCK):
        marked = (signal.flags & bit) > 0
        # a reading belongs to every step that its interval touches; an instant to the step that ends there
        first = np.searchsorted(edges, signal.begin[marked], side="right") - 1
        last = np.searchsorted(edges, signal.end[marked], side="left") - 1
        for a, b in zip(np.minimum(first, last), last, strict=True):
            flags[max(a, 0) : max(b + 1, 0)] |= bit
    return values, flags


def as_read(
    signal: Signal, edges: np.ndarray, method: str, coverage: float, *, bridges: bool
) -> tuple[np.ndarray, np.ndarray]:
    """As :func:`resample`, of an output, each value of which passes for a reading: a line over a lost one is none.

    A mean is partly covered where a reading was lost, though lines join those beside it. ``bridges`` says whether the
    mapping itself says how far apart readings may be: then lines over lost ones stay, interpolated.
    """
    values, flags = resample(signal, edges, method, coverage)
    middle, step = signal.middle, float(edges[1] - edges[0])
    if len(middle) < 2:
        return values, flags
    usual = float(np.median(np.diff(middle)))
    apart = max(usual, step)
    read, _ = resample(replace(signal, max_gap=min(signal.max_gap, LOST * apart)), edges, method, coverage)
    if method == "point":  # stamps may be a little late
        read = np.where(_nearest(signal, edges[1:]) <= _AT * apart, values, read)
    else:
        _, share = means_of(replace(signal, max_gap=min(signal.max_gap, LOST * usual)), edges)
        flags |= np.where(np.isfinite(read) & (share < _WHOLE), PARTLY, 0).astype(np.int8)
    if not bridges:
        return read, flags & ~np.where(np.isfinite(read), 0, PARTLY).astype(np.int8)
    made_up = np.isfinite(values) & ~np.isfinite(read)
    return values, flags | np.where(made_up, INTERPOLATED, 0).astype(np.int8)


def _nearest(signal: Signal, times: np.ndarray) -> np.ndarray:
    """How far the nearest usable reading is from each instant [s], same shape as ``times``."""
    middle = signal.clean().middle
    if not len(middle):
        return np.full(len(times), np.inf)
    after = np.clip(np.searchsorted(middle, times), 0, len(middle) - 1)
    before = np.maximum(after - 1, 0)
    return np.asarray(np.minimum(np.abs(times - middle[before]), np.abs(middle[after] - times)))
