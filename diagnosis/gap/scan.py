"""All candidates at once in the linearised problem: what could be detected at all, what is, and what looks alike.

For a candidate with signature e that nuisance and parameters cannot imitate (F = e'e, g = e'r after projection), the
log-likelihood ratio is the largest of a g - a^2 F / 2 over the amplitudes a that it may have (the score test, Cox and
Hinkley 1974, section 9.3). Its null is that of twins, and the family's is the largest over all candidates (Westfall and
Young 1993), so that many candidates cost their due; each in units of what it reaches in few of the twins itself, much
as with smallest p-values (the same, section 2.6): slow noise lets an offset reach what an infiltration never does, and
is not to hide one. What is tested is whether an amplitude is more than negligible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from diagnosis.effects import Effect
from diagnosis.gap.grams import Projected
from diagnosis.gap.twins import Twins
from diagnosis.where.significance import rank_p

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
    ``beyond``: what of ``ratio`` no amplitude that is negligible explains, which is what is tested; ``threshold``: what
    some candidate reaches of its own in a share LEVEL of the twins. A candidate is beyond its own exactly where
    ``adjusted`` is at most LEVEL.
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
    misfit: float
    misfit_p: float
    beyond: np.ndarray
    threshold: np.ndarray

    @property
    def order(self) -> list[int]:
        """Candidates, the most plausible first."""
        return [int(j) for j in np.argsort(-self.evidence, kind="stable")]

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest amplitudes [scales], each (effects,)."""
        return _bounds(self.effects)

    @property
    def nearest(self) -> np.ndarray:
        """Cosines between what the candidates may look like, in amplitudes of either sign if allowed, 0 at least."""
        low, high = self.bounds
        signs = [(-1.0, low < 0), (1.0, high > 0)]
        found = np.zeros(self.cosines.shape)
        for sign, own in signs:
            for other, its in signs:
                found = np.maximum(found, np.where(np.outer(own, its), sign * other * self.cosines, 0.0))
        return found

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
        misfit=misfit,
        misfit_p=float(rank_p(np.array([misfit]), twins.misfits)[0]),
        beyond=more,
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


def mass(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Log of what a standard normal holds between two bounds, low < high, of one shape; exact far out as well."""
    # the tail that is asked for is the lower one: there the logarithm loses no digits
    upper = low > 0
    low, high = np.where(upper, -high, low), np.where(upper, -low, high)
    most = log_ndtr(high)
    return np.asarray(most + np.log(-np.expm1(log_ndtr(low) - most)))


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
