"""What is not known about a recording's inputs, as pulses with a prior: see :mod:`diagnosis.fitting.nuisance`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from datagen.driving.occupancy import occupancy_prior
from datagen.driving.tables import SNAP, Piecewise
from diagnosis.fitting.drive import Drive
from diagnosis.fitting.nuisance import FIELDS, Level, Nuisance, no_nuisance
from diagnosis.fitting.within_steps import counted, replayed
from diagnosis.recording import DAY, HOUR, Recording
from shared.system import System

PULSE = 1800.0
"""Length of an occupancy pulse [s]: people come and go within the hour, and nobody knows when."""
HISTORY = (0.0, 0.25 * DAY, DAY, 3 * DAY)
"""Ends of the spans before the recording [s]; the last one reaches to the start of the warm-up."""
DRAWS = 4000
TINY = 1e-4
"""Share of the variance below which directions of the prior are left out."""
LEAST_PERSONS = 0.3
"""Of the largest standard deviation of unknown persons, the least at half hours of the day at which somebody may come.

They come at an unusual hour rarely, but then several at once: a normal prior with the variance of that takes the first
early comer of a Saturday for a gap of the model."""


def _joined(parts: Sequence[Nuisance]) -> Nuisance:
    parts = [one for one in parts if one.size]
    if not parts:
        return no_nuisance()
    factor = np.zeros((sum(one.size for one in parts), sum(one.factor.shape[1] for one in parts)))
    row = column = 0
    for one in parts:
        factor[row : row + one.size, column : column + one.factor.shape[1]] = one.factor
        row, column = row + one.size, column + one.factor.shape[1]
    levels = tuple(level for one in parts for level in one.levels)
    fields = {name: np.concatenate([getattr(one, name) for one in parts]) for name in FIELDS}
    return Nuisance(**fields, factor=factor, levels=levels)


def nuisance_of(
    system: System, recording: Recording, driven: Drive, *, occupancy: str, seed: int = 0
) -> tuple[Nuisance, dict[str, Piecewise]]:
    """The nuisance of a recording, and the signals that stand in for what it describes.

    Parameters
    ----------
    occupancy
        ``unknown``, ``measured``, or ``none`` for a system without.

    Returns
    -------
    tuple
        The pulses, whose heights are added to ``driven.signals`` updated by the second item.
    """
    parts, signals = [], {}
    for place, one in enumerate(system.inputs):
        if one.source == "occupancy" and occupancy == "unknown":
            part, signals[one.name] = _unknown_occupancy(system, place, driven, seed)
        elif one.source == "measured" and one.name not in recording.inputs and not driven.replayed:
            continue
        else:
            signal = driven.signals[one.name]
            part = _history(place, driven, recording, signal)
            if one.source == "occupancy":
                assert system.occupancy is not None
                within, signals[one.name] = counted(system.occupancy, place, recording, signal)
                part = _joined([within, part])
            elif one.source == "measured" and one.interpolation == "previous":
                part = _joined([replayed(place, recording, signal), part])
        parts.append(part)
    return _joined(parts), signals


def _spans(driven: Drive) -> list[tuple[float, float]]:
    """Spans before the recording [s], nearest first."""
    ends = [driven.start - back for back in HISTORY if driven.start - back > driven.begin + SNAP]
    if not ends:  # no warm-up, no history
        return []
    return [(max(b, driven.begin), a) for a, b in zip(ends, [*ends[1:], driven.begin], strict=True)]


@dataclass(frozen=True)
class Courses:
    """Courses of persons in a room of the average level, as the description draws them, by pulses.

    ``begin``, ``end`` (pulses,) [s]: half hours of the recording at which somebody may come, then spans before it;
    ``recorded`` is how many are of the former; ``heights`` (courses, pulses) [persons], of spans before the recording
    against the usual; ``level`` (courses,) by which each was divided, 1 on average; ``known`` what the rest of the
    signal is.
    """

    begin: np.ndarray
    end: np.ndarray
    recorded: int
    heights: np.ndarray
    level: np.ndarray
    known: Piecewise


def courses(system: System, driven: Drive, seed: int = 0) -> Courses:
    """Draw courses of the persons that nobody counted; the same ones for the same seed."""
    assert system.occupancy is not None
    back = round((driven.start - driven.begin) / PULSE)
    count = int(np.ceil((driven.stop - driven.start) / PULSE - 1e-9))
    edges = driven.start + PULSE * np.arange(-back, count + 1)
    draws = occupancy_prior(system.occupancy, edges, DRAWS, seed)
    level = draws.mean(axis=1)
    draws, level = draws[level > 0], level[level > 0]  # rooms that nobody uses have no level
    level = level / level.mean()
    draws = draws / level[:, None]
    usual = draws.mean(axis=0)
    edges[-1] = driven.stop
    comes = draws[:, back:].std(axis=0) > TINY * max(draws.std(), 1e-12)
    hour = np.floor(edges[back:-1] % DAY / PULSE + 1e-6).astype(int)
    inside = back + np.flatnonzero(np.isin(hour, hour[comes]))
    begins, ends, heights = [edges[inside]], [edges[inside + 1]], [draws[:, inside]]
    for a, b in _spans(driven):
        rows = (edges[:-1] > a - PULSE / 2) & (edges[:-1] < b - PULSE / 2)
        if rows.any():
            begins.append(np.array([a]))
            ends.append(np.array([b]))
            heights.append((draws[:, rows] - usual[rows]).mean(axis=1, keepdims=True))
    known = np.concatenate([usual[:back], np.zeros(count)])
    known[np.setdiff1d(np.arange(back, back + count), inside)] = usual[
        np.setdiff1d(np.arange(back, back + count), inside)
    ]
    return Courses(
        begin=np.concatenate(begins),
        end=np.concatenate(ends),
        recorded=len(inside),
        heights=np.concatenate(heights, axis=1),
        level=level,
        known=Piecewise(edges[:-1], known, "previous"),
    )


def _unknown_occupancy(system: System, place: int, driven: Drive, seed: int) -> tuple[Nuisance, Piecewise]:
    """Half-hourly persons in the recording and their means before it; the signal holds the usual day before it."""
    found = courses(system, driven, seed)
    covariance = np.atleast_2d(np.cov(found.heights, rowvar=False))
    variance = np.diag(covariance)[: found.recorded]
    rare = np.maximum(LEAST_PERSONS**2 * variance.max(initial=0.0) - variance, 0.0)
    covariance = covariance + np.diag(np.append(rare, np.zeros(len(covariance) - found.recorded)))
    level = np.log(found.level)
    return (
        Nuisance(
            column=np.full(len(found.begin), place),
            begin=found.begin,
            end=found.end,
            turns=np.zeros(len(found.begin), dtype=bool),
            recorded=found.begin > driven.start - SNAP,
            mean=found.heights.mean(axis=0),
            factor=_factor(covariance),
            levels=(Level(place, float(level.mean()), float(level.std())),),
        ),
        found.known,
    )


def _factor(covariance: np.ndarray) -> np.ndarray:
    """A factor F with F F' = covariance but for negligible directions, shape (n, rank)."""
    values, vectors = eigh(covariance)
    keep = values > TINY**2 * values[-1]
    return np.asarray(vectors[:, keep] * np.sqrt(values[keep]))


def _history(place: int, driven: Drive, recording: Recording, signal: Piecewise) -> Nuisance:
    """Offsets of an input before the recording, as much as such spans differ from day to day within it."""
    begin, end, spread = [], [], []
    for a, b in _spans(driven):
        found = _day_to_day(signal, recording, driven.start - b, min(b - a, DAY))
        if found > 0:
            begin.append(a)
            end.append(b)
            spread.append(found)
    count = len(begin)
    return Nuisance(
        column=np.full(count, place),
        begin=np.array(begin),
        end=np.array(end),
        turns=np.zeros(count, dtype=bool),
        recorded=np.zeros(count, dtype=bool),
        mean=np.zeros(count),
        factor=np.diag(spread) if count else np.empty((0, 0)),
    )


def _day_to_day(signal: Piecewise, recording: Recording, back: float, length: float) -> float:
    """Standard deviation over days of the difference between a span of the day and that of the day repeated."""
    grid = np.arange(recording.start, recording.stop, min(recording.step, HOUR)) + 0.5 * min(recording.step, HOUR)
    values = signal.at(grid)
    day = round(DAY / (grid[1] - grid[0]))
    days = len(values) // day
    if days < 3:  # too few days to compare: all of its variation
        return float(values.std())
    first = round((DAY - back % DAY - length) % DAY / DAY * day)
    width = max(round(length / DAY * day), 1)
    rolled = np.roll(values[: days * day], -first)[: days * day].reshape(days, day)[:, :width].mean(axis=1)
    return float(np.sqrt(2) * rolled.std())
