"""All candidates at once in the linearised problem: what could be detected at all, what is, and what looks alike.

For a candidate with signature e that nuisance and parameters cannot imitate (F = e'e, g = e'r after projection), the
log-likelihood ratio is the largest of a g - a^2 F / 2 over the amplitudes a that it may have (the score test, Cox and
Hinkley 1974, section 9.3). Its null is that of twins, and the family's is the largest over all candidates (Westfall and
Young 1993), so that many candidates cost their due; each in units of what it reaches in few of the twins itself, much
as with smallest p-values (the same, section 2.6): slow noise lets an offset reach what an infiltration never does, and
is not to hide one. What is tested is whether an amplitude is more than negligible.

The stretch of one channel that reads off the most: a gap of whatever cause that is there now and then.

Somebody turns the set point up for an afternoon, a door stands open on one day. In the square of all readings that is
lost, a slow discrepancy (:mod:`diagnosis.fitting.grams`) is too smooth for it, and no cell of hours has it alone; but
an offset over the right stretch stands out. For each stretch of a few lengths, parameters and nuisance refitted on the
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

from diagnosis.effects import Effect
from diagnosis.fitting.gaussian import mass
from diagnosis.fitting.grams import SIZES, Colour, Colours, Grams, Projected
from diagnosis.fitting.noise import HOUR
from diagnosis.gap.twins import Twins
from diagnosis.where.series import rank_p

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


NEGLIGIBLE = 0.1
"""Amplitude [scales] up to which an effect is none that matters: a model is right to no better than that, and finer
differences between a wall and its model would otherwise pass for small effects."""
RARE = 0.02
"""Share of the twins in which a candidate's log-likelihood ratio is above its unit."""
LEVEL = 0.02
"""Family-wise level at which a candidate is a gap, and at half of it each misfit of whatever kind: 0.05 in all."""
LEAST = 0.3
"""Least unit of a log-likelihood ratio: no candidate is seen by what is nothing for any other."""
SEEN = 0.05
"""Squared length of a signature, at one scale, below which a candidate takes no part."""
PRIORS = (0.5, 1.0, 2.0, 4.0)
"""Prior standard deviations of an amplitude [scales] over which a Bayes factor is averaged."""
APART = 3.0
"""Log-likelihood ratio that two candidates of detectable size must differ by to be told apart."""


@dataclass(frozen=True)
class Scan:
    """What the linearised problem says of each candidate.

    ``share`` of its whitened signature that nuisance and parameters cannot imitate; ``expected``
    log-likelihood ratio at one scale; ``amplitude`` [scales], ``ratio`` and ``evidence`` (log Bayes factor) found;
    ``adjusted`` family-wise p, and ``foremost`` the candidate with the least; ``cosines`` (candidates, candidates)
    between what cannot be imitated. ``p_value`` of the family, ``misfit_p`` of the residual's whole square.
    ``threshold``: what of its ratio that no negligible amplitude explains some candidate reaches of its own in a share
    LEVEL of the twins. A candidate is beyond its own exactly where ``adjusted`` is at most LEVEL.
    """

    effects: tuple[Effect, ...]
    share: np.ndarray
    expected: np.ndarray
    amplitude: np.ndarray
    ratio: np.ndarray
    evidence: np.ndarray
    adjusted: np.ndarray
    foremost: int | None
    cosines: np.ndarray
    p_value: float
    misfit_p: float
    threshold: np.ndarray

    @property
    def order(self) -> list[int]:
        """Candidates, the most plausible first."""
        return [int(j) for j in np.argsort(-self.evidence, kind="stable")]

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest amplitudes [scales], each (effects,)."""
        return _bounds(self.effects)

    def alike(self, j: int, size: float) -> list[int]:
        """Candidates that a gap of candidate ``j`` would be mistaken for, each with the best amplitude it may have.

        One that is hardly there is not told from nothing, and mistaken for nobody.

        Parameters
        ----------
        size
            Of the gap [scales], of each sign that ``j`` may have at that size; the largest that it may have, if less.
        """
        low, high = self.bounds
        size = min(size, max(high[j], -low[j]))
        length = np.sqrt(np.maximum(2 * self.expected, 1e-12))
        found = np.zeros(len(self.effects), dtype=bool)
        for one in (one for one in (-size, size) if low[j] <= one <= high[j]):
            if one**2 * self.expected[j] < APART:
                continue
            score = one * length[j] * length * self.cosines[j]
            other = np.clip(score / length**2, low, high)
            short = one**2 * self.expected[j] - (other * score - 0.5 * (other * length) ** 2)
            found |= short < APART
        found &= self.expected > 0.5 * SEEN
        return [i for i in np.flatnonzero(found).tolist() if i != j]


def scan(twins: Twins, effects: tuple[Effect, ...], misfit: float) -> Scan:
    """Test all candidates; ``misfit`` is the recording's square after estimation."""
    left = twins.left
    low, high = _bounds(effects)
    size = np.diag(left.information) if len(effects) else np.empty(0)
    kept = size > SEEN
    amplitude, ratio = ratios(left, left.score[:, None], low, high)
    _, null = ratios(left, left.score_of(twins.scores), low, high)
    # the recording among its twins, lest it be measured by a unit that they alone made
    unit = np.maximum(np.quantile(np.column_stack([ratio, null]), 1 - RARE, axis=1), LEAST)
    none = np.zeros((1, twins.scores.shape[1]))
    most = np.concatenate([none, (null / unit[:, None])[kept]]).max(axis=0)
    found = ratio[:, 0] * kept
    # over the best amplitude that does not matter; the twins' ratios are over none at all, which errs to the safe side
    small = np.minimum(high, NEGLIGIBLE)
    more = (ratio - ratios(left, left.score[:, None], np.maximum(low, -NEGLIGIBLE), small)[1])[:, 0] * kept
    beyond = more / unit
    largest = float(beyond.max(initial=0.0))
    length = np.sqrt(np.maximum(size, 1e-12))
    return Scan(
        effects=effects,
        share=np.clip(size / np.maximum(left.whole, 1e-12), 0, 1),
        expected=0.5 * size,
        amplitude=amplitude[:, 0],
        ratio=found,
        evidence=np.where(kept, _factors(left, low, high), 0.0),
        adjusted=rank_p(beyond, most),
        foremost=int(np.argmax(beyond)) if largest > 0 else None,
        cosines=np.clip(left.information / np.outer(length, length), -1, 1),
        p_value=float(rank_p(np.array([largest]), most)[0]),
        misfit_p=float(rank_p(np.array([misfit]), twins.misfits)[0]),
        threshold=max(_least_beyond(most), 1e-9) * unit,
    )


def _least_beyond(most: np.ndarray) -> float:
    """What is above this has a p of LEVEL at most among twins' largest (twins,); of few twins it is the largest."""
    above = int(LEVEL * (len(most) + 1) + 1e-9)
    return float(np.sort(most)[min(len(most) - above, len(most) - 1)])


def _bounds(effects: tuple[Effect, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest amplitudes [scales], each (effects,)."""
    return np.array([one.lower / one.scale for one in effects]), np.array([one.upper / one.scale for one in effects])


def ratios(left: Projected, score: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best amplitudes within bounds (effects,) [scales] and their log-likelihood ratios, both (effects, n)."""
    size = np.maximum(np.diag(left.information), 1e-12)[:, None]
    amplitude = np.clip(score / size, low[:, None], high[:, None])
    return amplitude, amplitude * score - 0.5 * amplitude**2 * size


def _factors(left: Projected, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Log Bayes factors of an amplitude that is normal within its bounds with any of the prior widths (effects,).

    Where no amplitude that is allowed explains anything, every one of them fits worse than none: they are not above 0.
    """
    size, score = np.diag(left.information), left.score
    found = []
    for sd in PRIORS:
        precision = size + 1 / sd**2
        mean, root = score / precision, np.sqrt(precision)
        one = -0.5 * np.log(precision * sd**2) + 0.5 * score**2 / precision
        found.append(one + mass((low - mean) * root, (high - mean) * root) - mass(low / sd, high / sd))
    return np.asarray(np.logaddexp.reduce(np.array(found), axis=0) - np.log(len(PRIORS)))
