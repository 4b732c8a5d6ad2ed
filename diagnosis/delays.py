"""Delays between columns of a recording: whose time stamps are hours off all others.

A room follows what warms it by a sum of decaying exponentials with positive weights: so does every passive network of
resistances and capacities, and a gas that air washes out. Each temperature and each concentration is therefore fitted
by the recording's weather and persons. These pass through first-order lags of several time constants, and no weight is
negative. A natural delay is part of such a fit; a reading that comes before its cause is not. The fit is made for every
shift of the stamps, and the shift that explains most is held against none.

What repeats every day in the same way (timetables, habits, set-backs) is taken out of both sides first, separately for
working days and weekends, and so is what changes slowly: a habit that nobody described is no evidence of a clock.
Errors are taken for first-order autoregressive. Neither a simulation nor a name is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from diagnosis.recording import DAY, HOUR, Recording
from shared.system import System
from shared.units import TEMPERATURES, spelled
from shared.variables import OccupancyInput, WeatherInput

LAGS = (0.0, 1.5, 6.0, 24.0, 96.0)
"""Time constants [h]: from air that mixes at once to heavy walls; weights between neighbours make those between."""
WIDEST = 24.0
"""Shifts are searched this far both ways [h]: a day, the largest difference of two zones on one date."""
FINEST = 0.5
"""Shifts are told to half an hour [h]: zones differ by whole or half hours, but for three."""
NATURAL = 1.0
"""No shift of an hour or less is told [h]: stamps of an hour's begin or end differ by as much."""
CHANCE = 1e-3
"""Probability that a recording without an error of its clocks is said to have one, over all that is tried together.

Of two hypotheses the wrong one is the likelier one by a factor c with probability 1 / c at most (Markov's inequality):
twice the log-likelihood has to grow by 2 log(tried / chance). It has to without the day that says so most, too: a day
on which something else happened is no clock.
"""
DOUBT = 0.05
"""The same where two hypotheses are compared that are both of a wrong clock: which columns are named."""
SHORTEST = 4 * DAY
"""No shorter recording is searched [s]: of less, the course of the day leaves too little."""
PIECE, PIECES = 28, 3
"""Days of a piece at most, and pieces of a long recording that are searched, evenly spread over it."""
SUN = "W/m2"
MOST = 3
"""So many different shifts are told at most."""


@dataclass(frozen=True)
class Delay:
    """Columns whose stamps are ``hours`` late; early, if negative.

    ``causes``: what they were held against; of inputs, what follows from them. ``gain``: by how much twice the
    log-likelihood grows where they are shifted. ``rivals``: inputs that may be shifted in their place, the other way.
    """

    names: tuple[str, ...]
    hours: float
    gain: float
    causes: tuple[str, ...]
    rivals: tuple[tuple[str, ...], ...]


def find_delays(system: System, recording: Recording) -> list[Delay]:
    """Columns whose time stamps are off by more than :data:`NATURAL`; none where the recording is too short or coarse.

    Outputs in a unit of temperature are held against the weather's temperatures and irradiances and the persons,
    outputs in ppm against the persons; inputs that nobody measured are no evidence.
    """
    if recording.stop - recording.start < SHORTEST or recording.step > NATURAL * HOUR:
        return []
    grid = _coarse(recording)
    persons = [one.name for one in system.inputs if isinstance(one, OccupancyInput) and _moves(grid, one.name)]
    weather = {
        one.name: spelled(one.unit)
        for one in system.inputs
        if isinstance(one, WeatherInput) and spelled(one.unit) in (*TEMPERATURES, SUN) and _moves(grid, one.name)
    }
    sun = tuple(name for name, unit in weather.items() if unit == SUN)
    inputs = [some for some in (tuple(persons), sun, tuple(weather)) if some]
    responses = []
    for one, values in zip(system.outputs, grid.outputs, strict=True):
        warmth = spelled(one.unit) in TEMPERATURES
        causes = [*weather, *persons] if warmth else persons if spelled(one.unit) == "ppm" else []
        if causes:
            responses.append(_Response(one.name, values, {name: grid.inputs[name] for name in causes}))
    found: list[Delay] = []
    while len(found) < MOST and (delay := _foremost(grid, responses, list(dict.fromkeys(inputs)))) is not None:
        found.append(delay)
        steps = -round(delay.hours * HOUR / grid.step)
        responses = [each.moved(delay.names, steps) for each in responses]
    return found


@dataclass(frozen=True)
class _Response:
    """An output (steps,) and the inputs that move it, each (steps,)."""

    name: str
    values: np.ndarray
    causes: dict[str, np.ndarray]

    def moved(self, names: Sequence[str], steps: int) -> _Response:
        """The same with some of its columns moved by so many steps to later times."""
        values = _moved(self.values, steps, lost=True) if self.name in names else self.values
        causes = {name: _moved(one, steps) if name in names else one for name, one in self.causes.items()}
        return replace(self, values=values, causes=causes)


def _moved(values: np.ndarray, steps: int, *, lost: bool = False) -> np.ndarray:
    """A series (steps,) moved to later times; its ends are missing, or hold the nearest value."""
    places = np.arange(len(values)) - steps
    inside = np.clip(places, 0, len(values) - 1)
    return np.where((places == inside) | (not lost), values[inside], np.nan)


def _moves(recording: Recording, name: str) -> bool:
    values = recording.inputs.get(name)
    return values is not None and name not in recording.assumed and bool(np.ptp(values) > 0)


def _is_read(values: np.ndarray) -> bool:
    """Whether a piece of an output (steps,) was read in most steps, and moves."""
    seen = np.isfinite(values)
    return bool((seen[1:] & seen[:-1]).mean() > 0.5 and np.ptp(values[seen]) > 0)


def _coarse(recording: Recording) -> Recording:
    """The recording in means over about half an hour, where its steps are shorter; what is over at its end is lost."""
    count = max(round(FINEST * HOUR / recording.step), 1)
    steps = len(recording.time) // count * count
    outputs = recording.outputs[:, :steps].reshape(len(recording.outputs), -1, count)
    known = np.isfinite(outputs)
    with np.errstate(invalid="ignore"):
        means = np.where(known, outputs, 0.0).sum(axis=2) / known.sum(axis=2)
    inputs = {name: values[:steps].reshape(-1, count).mean(axis=1) for name, values in recording.inputs.items()}
    time = recording.time[:steps].reshape(-1, count)[:, -1]
    return replace(recording, step=recording.step * count, time=time, outputs=means, inputs=inputs)


def _foremost(grid: Recording, responses: Sequence[_Response], inputs: Sequence[tuple[str, ...]]) -> Delay | None:
    """The columns whose shift explains most, if it explains enough; None if all clocks may be right.

    Parameters
    ----------
    inputs
        Which inputs may share a clock of their own.
    """
    count = round(WIDEST * HOUR / grid.step)
    shifts = np.arange(-count, count + 1)
    near = np.abs(shifts) <= max(round(NATURAL * HOUR / grid.step), 1)
    parts = [(piece, one, part) for piece, part in _pieces(grid) for one in responses if _is_read(one.values[part])]
    tables = [_Table(*each, shifts) for each in parts]
    responses = [one for one in responses if any(one is each for _, each, _ in parts)]
    if not responses:
        return None
    names = [one.name for one in responses]
    outputs = [(name,) for name in names] + ([tuple(names)] if len(names) > 1 else [])
    gains = {some: _together([one.days(one.causes, near) for one in tables if one.name in some]) for some in outputs}
    for some in inputs:  # an input that is late makes what follows it early
        gains[some] = _together([one.days(some, near)[:, ::-1] for one in tables])
    needed = 2 * np.log(len(gains) * (~near).sum() / CHANCE)
    best = {some: int(np.argmax(np.where(near, -np.inf, gain.sum(axis=0)))) for some, gain in gains.items()}
    height = {some: float(gains[some][:, place].sum()) for some, place in best.items()}
    top = max(height.values())
    equal = [some for some in gains if height[some] > top - 2 * np.log(1 / DOUBT)]
    first = max(equal, key=lambda some: (some in outputs, height[some]))
    by_day = gains[first][:, best[first]]
    if by_day.sum() - by_day.max() <= needed:
        return None
    place, named = best[first], first
    rivals: list[tuple[str, ...]] = []
    if first in outputs:  # others that say the same by themselves are named with it
        rivals = [some for some in equal if some not in outputs]
        beside = np.abs(shifts - shifts[place]) <= near.sum() // 2
        own = {name: float(gains[(name,)].sum(axis=0)[beside].max()) for name in names}
        named = tuple(name for name in names if name in first or own[name] > 2 * np.log(1 / DOUBT))
        causes = dict.fromkeys(cause for one in responses if one.name in named for cause in one.causes)
    else:
        causes = dict.fromkeys(one.name for one in responses if set(first) & set(one.causes))
    hours = round(float(shifts[place]) * grid.step / HOUR / FINEST) * FINEST
    return Delay(named, hours, height[first], tuple(causes), tuple(rivals))


def _together(gains: Sequence[np.ndarray]) -> np.ndarray:
    """Gains of several responses, each (days, shifts), added day by day."""
    days = max(len(one) for one in gains)
    return np.sum([np.pad(one, ((0, days - len(one)), (0, 0))) for one in gains], axis=0)


def _pieces(grid: Recording) -> list[tuple[Recording, slice]]:
    """The recording, or of a long one some pieces that are spread over it, and where each lies."""
    steps = len(grid.time)
    length = round(PIECE * DAY / grid.step)
    count = min(PIECES, max(steps // length, 1))
    begins = [0] if count == 1 else np.linspace(0, steps - length, count).astype(int).tolist()
    parts = [slice(begin, begin + length) for begin in begins]
    return [(replace(grid, time=grid.time[part]), part) for part in parts]


class _Table:
    """A response's fits at all shifts of all or some of its causes, on the same readings.

    Parameters
    ----------
    piece, part
        A piece of the recording and which of the response's steps are its own.
    shifts
        By how many steps the response is late, shape (shifts,).
    """

    def __init__(self, piece: Recording, response: _Response, part: slice, shifts: np.ndarray) -> None:
        self.name, self.causes, self._shifts = response.name, list(response.causes), shifts
        self._values, self._nuisance, step = response.values[part], _habits(piece.time, piece.step), piece.step
        self._day = np.floor((piece.time - 0.5 * step) / DAY).astype(int)
        day = max(round(DAY / step), 1)
        self._margin = margin = int(np.abs(shifts).max())
        lagged = []
        for values in [one[part] for one in response.causes.values()]:
            # beyond its ends the days there are repeated: that takes evidence from shifts, and from none else
            ends = (np.arange(-margin, 0) % day, len(values) - day + np.arange(margin) % day)
            lagged.append(_lagged(np.concatenate([values[ends[0]], values, values[ends[1]]]), step))
        self._lagged = np.stack(lagged)
        self._whiten(0.0)
        self._whiten(self._memory())

    def days(self, names: Sequence[str], near: np.ndarray) -> np.ndarray:
        """By how much twice the log-likelihood grows where the response is late against some causes, (days, shifts).

        Each day's share of it is that of the squares that a shift saves.
        """
        moving = np.array([name in names for name in self.causes])
        if not moving.any():
            return np.zeros((len(self._days), len(self._shifts)))
        left = np.array([self._days @ self._fit(moving, shift) ** 2 for shift in self._shifts]).T
        whole = np.maximum(left.sum(axis=0), 1e-300)
        plain = int(np.flatnonzero(near)[np.argmin(whole[near])])
        saved = left[:, [plain]] - left
        grown = self._free * np.log(whole[plain] / whole)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(np.abs(saved.sum(axis=0)) > 0, saved / saved.sum(axis=0), 0.0)
        return np.asarray(share * grown)

    def _whiten(self, memory: float) -> None:
        known = np.isfinite(self._values)
        self._rows = np.flatnonzero(known[1:] & known[:-1]) + 1
        self._correlation = memory
        basis, triangle = np.linalg.qr(self._difference(self._nuisance))
        self._basis = basis[:, np.abs(np.diag(triangle)) > 1e-9]
        self._target = self._without_habits(self._difference(self._values))
        day = self._day[self._rows]
        self._days = (day == np.unique(self._day)[:, None]).astype(float)
        self._free = max(len(self._rows) - self._basis.shape[1], 1)

    def _difference(self, values: np.ndarray, shift: int = 0) -> np.ndarray:
        rows = self._rows - shift
        return np.asarray(values[rows] - self._correlation * values[rows - 1])

    def _without_habits(self, values: np.ndarray) -> np.ndarray:
        return np.asarray(values - self._basis @ (self._basis.T @ values))

    def _fit(self, moving: np.ndarray, shift: int) -> np.ndarray:
        """What is left of the response (rows,) where it is late by so many steps against causes ``moving``."""
        columns = [
            self._difference(one, int(shift) * bool(move) - self._margin)
            for one, move in zip(self._lagged, moving, strict=True)
        ]
        drivers = self._without_habits(np.concatenate(columns, axis=1))
        try:
            weights, _ = nnls(drivers, self._target)
        except RuntimeError:  # its iterations did not end: nothing is explained
            return self._target
        return np.asarray(self._target - drivers @ weights)

    def _memory(self) -> float:
        """Correlation of what is left from step to step, of the shift of all causes that leaves least."""
        everything = np.ones(len(self.causes), dtype=bool)
        left = min((self._fit(everything, shift) for shift in self._shifts), key=lambda one: float(np.sum(one**2)))
        whole = np.full(len(self._values), np.nan)
        whole[self._rows] = left
        return float(np.clip(np.nanmean(whole[1:] * whole[:-1]) / max(np.nanmean(whole**2), 1e-300), 0.0, 0.95))


def _lagged(values: np.ndarray, step: float) -> np.ndarray:
    """A series (steps,) passed through first-order lags that start at its first day's mean, shape (steps, lags)."""
    from scipy.signal import lfilter  # it brings scipy.stats, which takes a second

    first = float(values[: max(round(DAY / step), 1)].mean())
    made = [values - first]
    for hours in LAGS[1:]:
        kept = np.exp(-step / (hours * HOUR))
        made.append(lfilter([1 - kept], [1, -kept], values - first))
    size = float(np.std(values))
    return np.stack(made, axis=1) / (size if size > 0 else 1.0)


def _habits(time: np.ndarray, step: float) -> np.ndarray:
    """What is no evidence: each step of the day on working days and on weekends, and slow changes, (steps, columns).

    Slow changes are straight lines between points that are about a day apart.
    """
    begin = time - 0.5 * step
    place = np.floor(begin % DAY / step).astype(int)
    weekend = np.floor(begin / DAY).astype(int) % 7 >= 5
    kind = place + (int(DAY / step) + 1) * weekend
    hours = (kind[:, None] == np.unique(kind)).astype(float)
    days = (begin - begin[0]) / DAY
    knots = np.linspace(0.0, days[-1], max(int(days[-1]), 1) + 1)
    slow = [np.interp(days, knots, one) for one in np.eye(len(knots))[1:]]
    return np.concatenate([hours, np.array(slow).T], axis=1)
