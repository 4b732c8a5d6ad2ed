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
from diagnosis.gap.grams import Grams
from diagnosis.gap.twins import Twins
from diagnosis.where.significance import rank_p

LENGTHS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Lengths of stretches [h]; each begins half its length after the one before."""
FEWEST = 2
"""Readings of a stretch at least. One that is off alone says how the recording began, or that somebody came, or a limit
was reached, within its step, which the model does at another minute. Twins, the model's own, show none of it."""
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
    left, inner = twins.left, grams.inner.size
    scores = np.column_stack([twins.product.score[:inner], twins.scores[:inner]])
    most = np.zeros(twins.scores.shape[1])
    factors, found = [], (0.0, 0, slice(0, 1), 0.0)
    for k in grams.channels:
        colour = colours.best[k]
        size = float(np.hypot(*colour[:2]))
        columns = grams.whitened_columns(k, colour)[:, :inner]
        rows = np.column_stack([grams.whitened(k, colour, grams.rows[k]), twins.rows[k]])
        for stretches in _stretches(grams.lin.problem.time):
            offsets = np.zeros((len(grams.lin.problem.time), len(stretches)))
            for j, one in enumerate(stretches):
                offsets[one, j] = size
            white = grams.whitened(k, colour, offsets)
            across = columns.T @ white
            imitated = cho_solve((left.root, True), across)
            length = np.sum(white**2, axis=0) - np.sum(across * imitated, axis=0)
            score = white.T @ rows - imitated.T @ scores
            kept = length > _LEAST
            if not kept.any():
                continue
            length, score = length[kept], score[kept]
            ratio = 0.5 * score**2 / length[:, None]
            most = np.maximum(most, ratio[:, 1:].max(axis=0))
            for sd in SIZES:
                precision = length + 1 / sd**2
                factors.append(0.5 * score[:, 0] ** 2 / precision - 0.5 * np.log(precision * sd**2))
            best = int(np.argmax(ratio[:, 0]))
            if ratio[best, 0] > found[0]:
                stretch = stretches[int(np.flatnonzero(kept)[best])]
                found = (float(ratio[best, 0]), k, stretch, float(score[best, 0] / length[best]) * size)
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


def _stretches(time: np.ndarray) -> Iterator[list[slice]]:
    """All stretches, some at a time: readings may be by the minute."""
    step, steps = float(time[1] - time[0]), len(time)
    fewest = FEWEST if step < LENGTHS[-1] * HOUR else 1  # a day is no instant
    lengths = sorted({max(fewest, round(hours * HOUR / step)) for hours in LENGTHS})
    every = [
        slice(begin, begin + length)
        for length in lengths
        for begin in range(0, steps - length + 1, max(1, length // 2))
    ]
    for begin in range(0, len(every), _AT_ONCE):
        yield every[begin : begin + _AT_ONCE]
