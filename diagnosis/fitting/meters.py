"""What a meter would have shown without its noise, as far as its readings tell: this drives the model in replay.

Driven by readings as they are, a model answers to their noise as well, which the room never felt. A fit then makes that
answer smaller, as a slope is too flat where what stands on the axis is noisy (attenuation; Carroll, Ruppert, Stefanski
and Crainiceanu 2006, Measurement Error in Nonlinear Models, chapter 3): the flow of a ventilation that hardly varies
seems to be much less than was read. So readings are replaced by their expectation (regression calibration, chapter 4
there), and what stays unknown of them is a nuisance (:mod:`diagnosis.gap.nuisances`).

The noise is as large as the description says, a part of it slow. The actuator's own course is taken for an
Ornstein-Uhlenbeck process around a level, over whose size and memory the expectation is taken as well: where readings
scatter no more than their noise does, they cannot tell a small variation from none. All precisions are banded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from diagnosis.recording import DAY, HOUR

SLOW = 0.3
"""Share of a meter's variance that is slow, and its memory: not known, but a meter without any would be rare."""
MEMORY = 6 * HOUR
SMALLEST, SIZES = 0.3, 12
"""Of the process, in standard deviations of the noise, and how many sizes up to three times those of the readings.
Smaller ones still would make it too sure that an air flow which hardly varies does not vary."""
MEMORIES = (2 * HOUR, 6 * HOUR, DAY, 4 * DAY)
NEGLIGIBLE = 0.003
"""Probability below which a size and memory are left out."""


@dataclass(frozen=True)
class _Course:
    """One size and memory: its probability, the expectation (steps,), and the factor of the banded precision.

    ``level`` (steps,) is what one standard deviation of the level does to the expectation.
    """

    share: float
    values: np.ndarray
    level: np.ndarray
    factor: np.ndarray


@dataclass(frozen=True)
class Cleared:
    """Readings without their noise: ``values`` (steps,) are what is expected [unit of the reading]."""

    values: np.ndarray
    courses: tuple[_Course, ...] = ()

    def covariance(self, weights: np.ndarray) -> np.ndarray:
        """Covariance of what stays unknown of weighted means (means, steps), shape (means, means)."""
        wide = np.zeros((2 * weights.shape[1], len(weights)))
        wide[0::2] = weights.T
        total = np.zeros((len(weights), len(weights)))
        for one in self.courses:
            away, level = weights @ (one.values - self.values), weights @ one.level
            within = wide.T @ cho_solve_banded((one.factor, True), wide)
            total += one.share * (within + np.outer(level, level) + np.outer(away, away))
        return total


def cleared(readings: np.ndarray, sd: float, step: float) -> Cleared:
    """Expected values of what was read.

    Parameters
    ----------
    readings
        Shape (steps,), NaN where lost; at least one is not.
    sd
        Standard deviation of the meter's noise [unit of the reading].
    step
        Between readings [s].
    """
    seen = np.isfinite(readings)
    mean, spread = float(readings[seen].mean()), float(readings[seen].std())
    if sd <= 0 or spread <= 0:
        return Cleared(_held(readings, seen))
    weight = seen / ((1 - SLOW) * sd**2)
    slow, _ = _process(len(readings), np.sqrt(SLOW) * sd, MEMORY, step)
    left = np.where(seen, readings - mean, 0.0)
    scores = np.repeat(np.stack([weight * left, weight], axis=1), 2, axis=0)
    found: list[tuple[float, _Course]] = []
    for size in np.geomspace(SMALLEST * sd, 3 * max(spread, sd), SIZES):
        for memory in MEMORIES:
            own, logdet = _process(len(readings), size, memory, step)
            factor = cholesky_banded(_joint(own, slow, weight), lower=True)
            likely = cho_solve_banded((factor, True), scores)
            # of readings and a level of one: products with the inverse of the readings' covariance
            products = scores[0::2].T @ np.stack([left, seen], axis=1) - scores.T @ likely
            level, information = products[0, 1] / products[1, 1], products[1, 1]
            evidence = 0.5 * (logdet - products[0, 0] + level * products[0, 1] - float(np.log(information)))
            moved = 1.0 - likely[0::2, 1]
            values = mean + likely[0::2, 0] + level * moved
            course = _Course(0.0, values, moved / np.sqrt(information), factor)
            found.append((evidence - float(np.log(factor[0]).sum()), course))
    share = np.exp(np.array([one for one, _ in found]) - max(one for one, _ in found))
    share = np.where(share > NEGLIGIBLE * share.sum(), share, 0.0)
    share /= share.sum()
    courses = tuple(replace(one, share=p) for p, (_, one) in zip(share.tolist(), found, strict=True) if p > 0)
    return Cleared(np.sum([one.share * one.values for one in courses], axis=0), courses)


def _process(steps: int, size: float, memory: float, step: float) -> tuple[np.ndarray, float]:
    """Precision of an Ornstein-Uhlenbeck process, (2, steps): diagonal, and beside it; and its log determinant."""
    decay = np.exp(-step / memory)
    fresh = size**2 * (1 - decay**2)
    diagonal = np.full(steps, (1 + decay**2) / fresh)
    diagonal[[0, -1]] = 1 / fresh
    logdet = -2 * np.log(size) - (steps - 1) * np.log(fresh)
    return np.stack([diagonal, np.append(np.full(steps - 1, -decay / fresh), 0.0)]), float(logdet)


def _joint(own: np.ndarray, slow: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Precision of the course and the slow noise given readings of their sum: in turn, (3, 2 steps) in banded form."""
    joint = np.zeros((3, 2 * len(weight)))
    joint[0, 0::2], joint[0, 1::2] = own[0] + weight, slow[0] + weight
    joint[1, 0::2] = weight
    joint[2, 0::2], joint[2, 1::2] = own[1], slow[1]
    return joint


def _held(readings: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Readings, those that were lost held from the one before: an actuator stays where it is."""
    last = np.maximum.accumulate(np.where(seen, np.arange(len(readings)), -1))
    return np.asarray(readings[np.where(last < 0, int(np.argmax(seen)), last)])
