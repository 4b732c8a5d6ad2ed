"""What windows of a training look like, and in what a recording is unlike all of them.

An estimator answers whatever it is shown. What it was never shown, a sensor that stands still or an outdoor temperature
of another climate, it answers wrongly with the same face; so a run remembers the extremes of its training, and an
estimate says which of them a recording passes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import torch
from pydantic import BaseModel, model_validator

from shared.variables import spaced
from trainer.reading.encoding import Encoding
from trainer.reading.windows import WindowSource

WINDOWS = 2000
"""Of each length that are looked at."""
CHUNK = 200
MARGIN = 0.1
"""How far beyond an extreme is still like it, as a share of its distance from the mean: the next 2,000 windows reach
beyond those of the first as well."""
LONGER = 3
"""A standstill that is longer than the longest by so many samples, and by the margin, is unlike it."""
LESS = 0.5
"""A spread of less than this share of the least is unlike it."""


RESTS = (24.0, 72.0)
"""Standstills of at least so many hours are told by where a channel rests: empty rooms are long at outdoor CO2, and a
sensor that died is anywhere."""


class Rest(BaseModel, extra="forbid"):
    """Where channels stood still for at least ``hours``, in the encoding's order; None where one never did [unit]."""

    hours: float
    lowest: list[float | None]
    highest: list[float | None]


class Familiar(BaseModel, extra="forbid"):
    """Extremes over windows of one length, of each recorded channel in the encoding's order [the channel's unit]."""

    length: int
    """samples of a window"""
    windows: int
    lowest: list[float]
    highest: list[float]
    least_sd: list[float]
    """least standard deviation within a window"""
    longest_still: list[int]
    """most readings in a row that were equal"""
    rests: list[Rest] = []
    """of standstills of :data:`RESTS` that fit into a window; none in runs of before these were looked at"""

    @model_validator(mode="after")
    def _fits(self) -> Familiar:
        """One figure of each kind for each channel."""
        for name in ("highest", "least_sd", "longest_still"):
            if len(getattr(self, name)) != len(self.lowest):
                raise ValueError(f"{name}: has {len(getattr(self, name))} values; expected {len(self.lowest)}")
        if any(len(one.lowest) != len(self.lowest) or len(one.highest) != len(self.lowest) for one in self.rests):
            raise ValueError(f"rests: expected {len(self.lowest)} values in each")
        return self


class _Looks(NamedTuple):
    """Of windows, shape (windows, channels) each; not a number where nothing was read."""

    lowest: np.ndarray
    highest: np.ndarray
    sd: np.ndarray
    still: np.ndarray
    level: np.ndarray


def looks(values: np.ndarray) -> _Looks:
    """Extremes, spread, longest standstill and its level, of windows (windows, length, channels); NaN is missing."""
    values = np.asarray(values, dtype=np.float64)
    seen = np.isfinite(values)
    count = seen.sum(axis=1)
    nothing = np.where(count > 0, 0.0, np.nan)
    lowest = np.where(seen, values, np.inf).min(axis=1) + nothing
    highest = np.where(seen, values, -np.inf).max(axis=1) + nothing
    mean = np.where(seen, values, 0.0).sum(axis=1) / np.maximum(count, 1)
    off = np.where(seen, values - mean[:, None], 0.0)
    sd = np.sqrt((off**2).sum(axis=1) / np.maximum(count, 1)) + nothing
    moves = np.ones(values.shape, dtype=bool)
    moves[:, 1:] = values[:, 1:] != values[:, :-1]  # a reading that is missing ends a standstill
    place = np.arange(values.shape[1])[None, :, None]
    since = place - np.maximum.accumulate(np.where(moves, place, 0), axis=1)
    level = np.take_along_axis(values, since.argmax(axis=1)[:, None], axis=1)[:, 0]
    return _Looks(lowest, highest, sd, since.max(axis=1) + 1 + nothing, level)


def familiar(source: WindowSource, rows: np.ndarray, seed: int) -> list[Familiar]:
    """The extremes over random windows of the records ``rows`` of a source, under its sensors, for each length."""
    encoding, found = source.encoding, []
    for length in encoding.lengths:
        rng = np.random.default_rng([seed, length])
        generator = torch.Generator().manual_seed(int(rng.integers(2**31)))
        parts = []
        for begin in range(0, WINDOWS, CHUNK):
            which = torch.from_numpy(rng.choice(rows, size=min(CHUNK, WINDOWS - begin)))
            start = torch.from_numpy(rng.integers(source.values.shape[1] - length + 1, size=len(which)))
            values = source.values[which[:, None], start[:, None] + torch.arange(length)]
            parts.append(looks(source.sensors(values.cpu(), generator).numpy()))
        lowest, highest, sd, still, level = (np.concatenate(each) for each in zip(*parts, strict=True))
        found.append(
            Familiar(
                length=length,
                windows=len(lowest),
                lowest=lowest.min(axis=0).tolist(),
                highest=highest.max(axis=0).tolist(),
                least_sd=sd.min(axis=0).tolist(),
                longest_still=still.max(axis=0).astype(int).tolist(),
                rests=[
                    _rest(still * encoding.step / 3600 >= hours, level, hours)
                    for hours in RESTS
                    if hours <= length * encoding.step / 3600
                ],
            )
        )
    return found


def _rest(long: np.ndarray, level: np.ndarray, hours: float) -> Rest:
    """Where channels rest that stood still for ``long`` (windows, channels) at a ``level``."""
    some = np.any(long, axis=0).tolist()
    low = np.where(long, level, np.inf).min(axis=0)
    high = np.where(long, level, -np.inf).max(axis=0)
    return Rest(
        hours=hours,
        lowest=[one if there else None for one, there in zip(low.tolist(), some, strict=True)],
        highest=[one if there else None for one, there in zip(high.tolist(), some, strict=True)],
    )


def of_both(one: list[Familiar], other: list[Familiar]) -> list[Familiar]:
    """The extremes over the windows of two trainings on the same channels, for the lengths that both remember."""
    first = {known.length: known for known in one}
    return [_joined(first[known.length], known) for known in other if known.length in first]


def _joined(one: Familiar, other: Familiar) -> Familiar:
    rests = {rest.hours: rest for rest in one.rests}
    return Familiar(
        length=one.length,
        windows=one.windows + other.windows,
        lowest=np.minimum(one.lowest, other.lowest).tolist(),
        highest=np.maximum(one.highest, other.highest).tolist(),
        least_sd=np.minimum(one.least_sd, other.least_sd).tolist(),
        longest_still=np.maximum(one.longest_still, other.longest_still).tolist(),
        rests=[
            Rest(
                hours=rest.hours,
                lowest=_farther(min, rests[rest.hours].lowest, rest.lowest),
                highest=_farther(max, rests[rest.hours].highest, rest.highest),
            )
            for rest in other.rests
            if rest.hours in rests
        ],
    )


def _farther(
    choose: Callable[[Iterable[float]], float], one: list[float | None], other: list[float | None]
) -> list[float | None]:
    """Of each channel the lower or the higher level; that of the one training in which it rested, if it was one."""
    pairs = zip(one, other, strict=True)
    known = [[level for level in pair if level is not None] for pair in pairs]
    return [choose(levels) if levels else None for levels in known]


def _elsewhere(known: Familiar, encoding: Encoding, k: int, still: float, level: float) -> Rest | None:
    """Where channel ``k`` rests in training, if a standstill of ``still`` samples at ``level`` [unit] is not there."""
    for rest in sorted(known.rests, key=lambda one: -one.hours):
        low, high = rest.lowest[k], rest.highest[k]
        if still * encoding.step / 3600 >= rest.hours and low is not None and high is not None:
            mean = encoding.mean[k]
            inside = low - MARGIN * abs(mean - low) <= level <= high + MARGIN * abs(high - mean)
            return None if inside else rest
    return None


def stuck(values: np.ndarray, known: Familiar, encoding: Encoding) -> tuple[int, int] | None:
    """The first window (windows, length, recorded) with an output that never moved, and the output's place.

    Only outputs that never stood still for so long in training, or not there: a heater may well be off for a week, and
    an empty room at outdoor CO2; and only those that every recording has: what an optional one is in a building that
    was never excited may well be constant. A reading that was lost does not make a dead sensor move, nor does it count
    as one at which it stood still.
    """
    found = looks(values)
    longest, counts = _longest(known), np.isfinite(values).sum(axis=1)
    for i, k in np.argwhere((found.lowest == found.highest)[:, : encoding.outputs]).tolist():
        count = int(counts[i, k])
        elsewhere = _elsewhere(known, encoding, k, count, found.lowest[i, k])
        if encoding.recorded[k] not in encoding.optional and (count > longest[k] or elsewhere):
            return i, k
    return None


def _longest(known: Familiar) -> np.ndarray:
    """The longest standstill (channels,) that is like the training [samples]."""
    longest = np.array(known.longest_still)
    return np.asarray(longest + np.maximum(LONGER, MARGIN * longest))


def unlike(values: np.ndarray, known: Familiar, encoding: Encoding) -> list[str]:
    """In what a window (length, recorded) [the run's units] is unlike those of a training, a sentence each."""
    low, high, sd, still, level = (part[0] for part in looks(values[None]))
    notes = []
    for k, name in enumerate(encoding.recorded):
        if name in encoding.constant or np.isnan(low[k]):
            continue
        unit = spaced(encoding.units[k])
        mean, hours = encoding.mean[k], encoding.step / 3600
        lowest, highest, least = known.lowest[k], known.highest[k], known.least_sd[k]
        if low[k] < lowest - MARGIN * abs(mean - lowest):
            notes.append(f"{name} falls to {low[k]:.4g}{unit}, never below {lowest:.4g}{unit} in training")
        if high[k] > highest + MARGIN * abs(highest - mean):
            notes.append(f"{name} rises to {high[k]:.4g}{unit}, never above {highest:.4g}{unit} in training")
        if still[k] > _longest(known)[k]:
            longest = known.longest_still[k] * hours
            notes.append(
                f"{name} stands still for {still[k] * hours:.3g} h, never longer than {longest:.3g} h in training"
            )
        elif rest := _elsewhere(known, encoding, k, still[k], level[k]):
            notes.append(
                f"{name} stands still at {level[k]:.4g}{unit} for {still[k] * hours:.3g} h; in training it did so for"
                f" {rest.hours:g} h and more at {rest.lowest[k]:.4g} to {rest.highest[k]:.4g}{unit} only"
            )
        elif sd[k] < LESS * least:
            by = f"by {sd[k]:.2g}{unit} (standard deviation)"
            notes.append(f"{name} varies {by}, never by less than {least:.2g}{unit} in training")
    return notes
