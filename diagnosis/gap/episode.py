"""The stretch of one channel that reads off the most: a gap of whatever cause that is there now and then.

Somebody turns the set point up for an afternoon, a door stands open on one day. In the square of all readings that is
lost, a slow discrepancy (:mod:`diagnosis.gap.colours`) is too smooth for it, and no cell of hours has it alone; but an
offset over the right stretch stands out. For each stretch of a few lengths, parameters and nuisance refitted on the
straight line, there is a log-likelihood ratio (the score test, as in :mod:`diagnosis.gap.scan`). The largest is judged
by the largest in twins; and what an episode gains at all is the mean of Bayes factors over all stretches and over
sizes, each as plausible as any other before (Kass and Raftery 1995, section 3.2).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve
from scipy.special import logsumexp

from diagnosis.fitting.noise import HOUR
from diagnosis.gap.colours import SIZES, Colours
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.twins import Twins
from diagnosis.where.significance import rank_p

LENGTHS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Lengths of stretches [h]; each begins half its length after the one before."""
FEWEST = 2
"""Readings of a stretch at least, lost ones not counted. One that is off alone says how the recording began, or that
somebody came, or a limit was reached, within its step, which the model does at another minute. Twins, the model's own,
show none of it."""
FEW = 4
"""Where an hour has so few readings, none of a stretch may explain more alone than all of it: then it is that one."""
BEGINNING = 6.0
"""Hours at the beginning of a recording in which no stretch begins: a room whose days before were unlike the first one
begins elsewhere than the model does, and a controller that is at its limit then makes more of it than the history's
straight line."""
_AT_ONCE = 256
_LEAST = 0.05
"""Squared length, for an offset of one standard deviation, below which nobody can tell an episode."""


@dataclass(frozen=True)
class Episode:
    """The stretch that stands out most: readings ``first`` to ``last`` (included) of a channel, and its offset [unit].

    ``ratio``: log-likelihood ratio. ``p_value`` of it over all stretches of all channels. ``gain``: of an episode
    somewhere, in log evidence.
    """

    channel: int
    first: int
    last: int
    offset: float
    ratio: float
    p_value: float
    gain: float


def largest_episode(grams: Grams, colours: Colours, twins: Twins) -> Episode | None:
    """Find and judge it; None where there is nothing to see of any (no channel has readings that tell).

    Parameters
    ----------
    twins
        Of the same linearised fit and colours.
    """
    most = np.zeros(twins.scores.shape[1])
    factors, found = [], (0.0, 0, slice(0, 1), 0.0)
    step = float(grams.lin.problem.time[1] - grams.lin.problem.time[0])
    for k in grams.channels:
        channel = _Channel(grams, colours.best[k], twins, k)
        alone = channel.alone() if channel.few else None
        readings = np.concatenate([[0], np.cumsum(grams.observed[k])])
        for stretches in _stretches(grams.lin.problem.time):
            length, score = channel.asked(stretches)
            count = np.array([readings[one.stop] - readings[one.start] for one in stretches])
            kept = (length > _LEAST) & (count >= (fewest(step) if channel.few else FEW + 1))
            if not kept.any():
                continue
            ratio = 0.5 * score**2 / np.maximum(length, _LEAST)[:, None]
            if alone is not None:
                for j in np.flatnonzero(kept):
                    beaten = alone[stretches[j]].max(axis=0) > ratio[j] * (1 + 1e-9)
                    ratio[j, beaten] = score[j, beaten] = 0.0
            length, score, ratio = length[kept], score[kept], ratio[kept]
            most = np.maximum(most, ratio[:, 1:].max(axis=0))
            for sd in SIZES:
                precision = length + 1 / sd**2
                factors.append(0.5 * score[:, 0] ** 2 / precision - 0.5 * np.log(precision * sd**2))
            best = int(np.argmax(ratio[:, 0]))
            if ratio[best, 0] > found[0]:
                stretch = stretches[int(np.flatnonzero(kept)[best])]
                found = (float(ratio[best, 0]), k, stretch, float(score[best, 0] / length[best]) * channel.size)
    if not factors:
        return None
    ratio_, k, stretch, offset = found
    every = np.concatenate(factors)
    return Episode(
        channel=k,
        first=stretch.start,
        last=stretch.stop - 1,
        offset=offset,
        ratio=ratio_,
        p_value=float(rank_p(np.array([ratio_]), most)[0]),
        gain=float(logsumexp(every) - np.log(len(every))),
    )


class _Channel:
    """One channel's whitened columns and readings, of the recording and of its twins."""

    def __init__(self, grams: Grams, colour: Colour, twins: Twins, k: int) -> None:
        self.grams, self.colour, self.left, inner = grams, colour, twins.left, grams.inner.size
        self.size = float(np.hypot(*colour[:2]))
        self.columns = grams.whitened_columns(k, colour)[:, :inner]
        self.rows = np.column_stack([grams.whitened(k, colour, grams.rows[k]), twins.rows[k]])
        self.scores = np.column_stack([twins.product.score[:inner], twins.scores[:inner]])
        self.k, self.time = k, grams.lin.problem.time

    @property
    def few(self) -> bool:
        """Whether the shortest stretches have few readings."""
        return LENGTHS[0] * HOUR / float(self.time[1] - self.time[0]) <= FEW

    def asked(self, stretches: list[slice]) -> tuple[np.ndarray, np.ndarray]:
        """Squared lengths (stretches,) of offsets of one size, and their scores (stretches, 1 + twins)."""
        offsets = np.zeros((len(self.time), len(stretches)))
        for j, one in enumerate(stretches):
            offsets[one, j] = self.size
        white = self.grams.whitened(self.k, self.colour, offsets)
        across = self.columns.T @ white
        imitated = cho_solve((self.left.root, True), across)
        length = np.sum(white**2, axis=0) - np.sum(across * imitated, axis=0)
        return length, white.T @ self.rows - imitated.T @ self.scores

    def alone(self) -> np.ndarray:
        """Log-likelihood ratios of an offset of each reading alone, shape (steps, 1 + twins)."""
        found = []
        for begin in range(0, len(self.time), _AT_ONCE):
            some = [slice(i, i + 1) for i in range(begin, min(begin + _AT_ONCE, len(self.time)))]
            length, score = self.asked(some)
            found.append(np.where(length[:, None] > _LEAST, 0.5 * score**2 / np.maximum(length, _LEAST)[:, None], 0.0))
        return np.concatenate(found)


def fewest(step: float) -> int:
    """Readings that a stretch has at least; a day is no instant."""
    return FEWEST if step < LENGTHS[-1] * HOUR else 1


def _stretches(time: np.ndarray) -> Iterator[list[slice]]:
    """All stretches but those of the beginning, some at a time: readings may be by the minute."""
    step, steps = float(time[1] - time[0]), len(time)
    earliest = int(np.ceil(BEGINNING * HOUR / step))
    lengths = sorted({max(fewest(step), round(hours * HOUR / step)) for hours in LENGTHS})
    every = [
        slice(begin, begin + length)
        for length in lengths
        for begin in range(0, steps - length + 1, max(1, length // 2))
        if begin >= earliest
    ]
    for begin in range(0, len(every), _AT_ONCE):
        yield every[begin : begin + _AT_ONCE]
