"""Random occupancy: how many persons are in the room, minute by minute.

A day is a sum of steps: some persons come, now and then some leave and come back, at last all leave. Every number of
a day is a fixed function of a row of uniform random numbers, so that days are drawn in one vectorised sweep and a
day's draw does not depend on which days are asked for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from datagen.driving.tables import Piecewise
from shared.signals import Occupancy

_DAY = 24.0
_HOUR = 3600.0
_JITTER_LIMIT = 3.0
"""Starts and ends of days stay within this many standard deviations of the usual."""


@dataclass(frozen=True, eq=False)
class Draw:
    """Independent uniform numbers that an occupancy is a fixed function of.

    ``usual`` (..., 3) are of headcount, arrival and duration, ``rows`` (..., days, numbers) of each day, and ``days``
    (days,) the days' numbers since time zero. Leading axes are independent draws.
    """

    usual: np.ndarray
    rows: np.ndarray
    days: np.ndarray


def sample_occupancy(spec: Occupancy, rng: np.random.Generator, start: float, stop: float) -> Piecewise:
    """Draw the persons present from ``start`` to ``stop`` [s since time zero]; see :func:`draw_numbers`."""
    return occupancy_of(spec, draw_numbers(spec, rng, start, stop), start, stop)


def draw_numbers(spec: Occupancy, rng: np.random.Generator, start: float, stop: float) -> Draw:
    """Draw what makes an occupancy from ``start`` to ``stop`` [s since time zero].

    A day's draw depends on the state of ``rng`` and the day's number alone: another span of time shows the same
    persons wherever the two overlap, also when it begins before time zero.
    """
    usual = rng.random(3)
    after, before = (np.random.default_rng(seed) for seed in rng.integers(2**63, size=2))
    first = int(np.floor(start / _HOUR / _DAY)) - lead_days(spec)
    last = int(np.ceil(stop / _HOUR / _DAY))
    slots = _slots(spec)
    # two sequences of days that both start at time zero, one each way, each read in order from its beginning
    rows = [after.random((max(last, 0), slots)), before.random((max(-first, 0), slots))]
    days = np.arange(first, last)
    return Draw(usual, np.concatenate([rows[1][::-1], rows[0]])[days + max(-first, 0)], days)


def occupancy_of(spec: Occupancy, draw: Draw, start: float, stop: float) -> Piecewise:
    """The persons present from ``start`` to ``stop`` [s since time zero] that a draw makes, kind ``previous``.

    Whole numbers >= 0. The first time is ``start``; the others are changes.
    """
    times, changes = _steps(spec, _draw_usual(spec, draw.usual), draw.rows, draw.days)
    times, changes = times.ravel() * _HOUR, changes.ravel()
    order = np.argsort(times, kind="stable")
    times, persons = times[order], np.cumsum(changes[order])
    # of changes at one time the last counts; what came before the start is the first value
    now = int(np.searchsorted(times, start, side="right"))
    initial = persons[now - 1] if now else 0
    times = np.concatenate([[start], times[now:]])
    persons = np.concatenate([[initial], persons[now:]])
    keep = np.append(np.diff(times) > 0, True)
    times, persons = times[keep], persons[keep]
    keep = np.append(True, np.diff(persons) != 0) & (times < stop)
    keep[0] = True
    return Piecewise(times[keep], persons[keep].astype(np.float64), "previous")


def sized(spec: Occupancy, amount: float) -> Occupancy:
    """The occupancy of a system whose density counts per ``amount``, such as its floor area [unit of ``spec.per``].

    Its headcount is uniform between the least and the greatest density, within the description's headcount.
    """
    if spec.density is None:
        return spec
    least, most = (min(max(round(density * amount), spec.headcount[0]), spec.headcount[1]) for density in spec.density)
    return spec.model_copy(update={"headcount": (least, most)})


def occupancy_prior(spec: Occupancy, edges: ArrayLike, draws: int, seed: int) -> np.ndarray:
    """Draw the mean number of persons in each interval, shape (draws, n), distributed as by :func:`sample_occupancy`.

    It is what is known before any measurement. ``edges`` are the strictly increasing times between the intervals, shape
    (n + 1,) [s since time zero]; a draw is an independent system. Raises ValueError if the edges do not increase.
    """
    edges = np.asarray(edges, dtype=np.float64)
    return occupancy_means(spec, prior_draw(spec, edges, draws, seed), edges)


def prior_draw(spec: Occupancy, edges: np.ndarray, draws: int, seed: int) -> Draw:
    """What makes the occupancy of so many independent systems between the first and the last of ``edges`` (n + 1,) [s].

    Raises
    ------
    ValueError
        If the edges do not increase.
    """
    if edges.ndim != 1 or edges.size < 2 or (np.diff(edges) <= 0).any():
        raise ValueError("edges of intervals must be at least two and strictly increase")
    rng = np.random.default_rng(seed)
    first, last = edges[0] / _HOUR / _DAY, edges[-1] / _HOUR / _DAY
    days = np.arange(int(np.floor(first)) - lead_days(spec), int(np.ceil(last)))
    usual = rng.random((3, draws)).T
    return Draw(usual, rng.random((draws, len(days), _slots(spec))), days)


def headcounts(spec: Occupancy, draw: Draw) -> np.ndarray:
    """How many persons belong to each of the systems of a draw, shape (...,)."""
    return _draw_usual(spec, np.moveaxis(draw.usual, -1, 0))[0]


def occupancy_means(spec: Occupancy, draw: Draw, edges: np.ndarray) -> np.ndarray:
    """Mean persons in each interval between ``edges`` (n + 1,) [s] of many draws (draws, ...), shape (draws, n)."""
    edges, draws, intervals = edges / _HOUR, len(draw.rows), len(edges) - 1
    usual = _draw_usual(spec, np.moveaxis(draw.usual, -1, 0)[..., None])
    times, changes = _steps(spec, usual, draw.rows, draw.days)
    system = np.broadcast_to(np.arange(draws)[:, None, None], times.shape).ravel()
    times, changes = times.ravel(), changes.ravel()
    # a step in interval j counts for the rest of j and for all later intervals; steps before the first count fully
    j = np.searchsorted(edges, times, side="right") - 1
    inside = (j >= 0) & (j < intervals) & (changes != 0)
    past = (j < 0) & (changes != 0)
    cell = system[inside] * intervals + j[inside]
    share = (edges[j[inside] + 1] - times[inside]) / (edges[j[inside] + 1] - edges[j[inside]])
    size = draws * intervals
    partial = np.bincount(cell, changes[inside] * share, size).reshape(draws, intervals)
    full = np.bincount(cell, changes[inside], size).reshape(draws, intervals)
    base = np.bincount(system[past], changes[past], draws)[:, None]
    means = base + np.cumsum(full, axis=1) - full + partial
    return np.maximum(means, 0.0)  # rounding leaves -1e-15 in empty hours


def _slots(spec: Occupancy) -> int:
    """Uniform numbers that a day needs: presence, attendance, start, end, number of gaps; three for each gap."""
    return 5 + 3 * spec.gaps[1]


def lead_days(spec: Occupancy) -> int:
    """How many days before may still reach into a day: work that goes on after midnight."""
    longest = spec.arrival[1] + spec.duration[1] + 2 * _JITTER_LIMIT * spec.jitter
    return int(np.ceil(longest / _DAY))


def _between(span: tuple[float, float], u: np.ndarray) -> np.ndarray:
    return span[0] + (span[1] - span[0]) * u


def _integer(span: tuple[int, int], u: np.ndarray) -> np.ndarray:
    """Uniform over the whole numbers of a span, ends included."""
    return np.minimum(np.floor(span[0] + (span[1] + 1 - span[0]) * u), span[1])


def _draw_usual(spec: Occupancy, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a system draws once: headcount, usual arrival [h], usual length of the day [h]."""
    return _integer(spec.headcount, u[0]), _between(spec.arrival, u[1]), _between(spec.duration, u[2])


def _steps(
    spec: Occupancy, usual: tuple[np.ndarray, np.ndarray, np.ndarray], u: np.ndarray, days: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Steps of days: times [h since time zero] and changes of persons, shapes (..., days, 2 + 2 gaps).

    ``u`` has shape (..., days, slots). Steps that do not happen have change 0; the changes of a day sum to 0.
    """
    from scipy.special import ndtri  # a quarter of a second, for which a description that is refused need not wait

    headcount, arrival, duration = usual
    weekend = days % 7 >= 5
    comes = u[..., 0] < np.where(weekend, spec.weekend, 1.0 - spec.absence)
    present = np.rint(_between(spec.attendance, u[..., 1]) * headcount)
    # a day on which somebody comes has somebody, unless the room has nobody to come or nobody ever attends
    present = comes * np.minimum(np.maximum(present, float(spec.attendance[1] > 0)), headcount)
    with np.errstate(divide="ignore"):  # a uniform number may be exactly 0
        jitter = spec.jitter * np.clip(ndtri(u[..., 2:4]), -_JITTER_LIMIT, _JITTER_LIMIT)
    begin = np.maximum(arrival + jitter[..., 0], 0.0)
    end = np.maximum(arrival + duration + jitter[..., 1], begin)
    count = _integer(spec.gaps, u[..., 4])
    times, changes = [begin, end], [present, -present]
    # each absence has its own part of the day, so that no one leaves twice at a time
    part = (end - begin) / np.maximum(count, 1.0)
    for g in range(spec.gaps[1]):
        where, length, share = (u[..., 5 + 3 * g + k] for k in range(3))
        # a little less than the part: rounding must not let two absences overlap
        length = np.minimum(_between(spec.gap_duration, length), 0.95 * part)
        leave = begin + g * part + where * (part - length)
        # of an absence somebody is absent, unless the share is never above 0
        least = np.minimum(present, float(spec.gap_share[1] > 0))
        away = np.clip(np.rint(_between(spec.gap_share, share) * present), least, present)
        away = away * (g < count)
        times += [leave, leave + length]
        changes += [-away, away]
    clock = _DAY * np.asarray(days, dtype=np.float64)
    return np.stack(times, axis=-1) + clock[:, None], np.stack(np.broadcast_arrays(*changes), axis=-1)
