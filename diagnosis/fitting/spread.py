"""How sure a fit is, beyond the curvature at its mode.

- **Doubt**: parameters also make up for what the model is not, and a fit's own covariance knows no such. What a model
  takes for granted is among the unknowns (:mod:`diagnosis.fitting.unknowns`), but not all of it: weather that was read
  with an error, noise that is slower than it looks. Rooms of an opened blind check without an effect, whose walls are
  finer than the model's, told what that takes: the fit's own standard deviations were too small by 1.6 where persons
  were counted, by 1.2 in replay. docs/measurements.md has all conditions.
- **Swings**: where nobody counted the persons, each round draws its straight lines about other histories of the room,
  and a fit may swing for ever: small room and many persons, large room and few. From some round on lines are drawn
  about the mean of the last optima (averaged fixed-point iteration: Krasnoselskii, Uspekhi Mat. Nauk 10, 1955); what
  still moves in the end is not known better than by how much it moves.
- **Stretches**: a posterior that is no parabola has its spread by simulations, not by curvature at the mode alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import eigh

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.problem import Problem

DOUBT = 1.5
"""A recording's information on the unknowns counts for 1 / DOUBT^2: its standard deviations are so much larger."""


def doubted(covariance: np.ndarray) -> np.ndarray:
    """Covariance (unknowns, unknowns) of a posterior whose prior is standard normal, its recording doubted.

    Correlations are those of the doubted posterior as a whole, standard deviations those of :func:`doubted_sd`: as a
    whole the prior holds together what the recording hardly tells apart, and intervals came out too narrow.
    """
    prior = np.eye(len(covariance))
    whole = np.linalg.inv(prior + (np.linalg.inv(covariance) - prior) / DOUBT**2)
    scale = doubted_sd(np.sqrt(np.diag(covariance))) / np.sqrt(np.diag(whole))
    return np.asarray(whole * np.outer(scale, scale))


def doubted_sd(sd: np.ndarray) -> np.ndarray:
    """Standard deviations (unknowns,) of such a posterior, each by itself: the prior keeps its say."""
    told = np.maximum(np.asarray(sd) ** -2.0 - 1.0, 0.0)
    return np.asarray(1.0 / np.sqrt(1.0 + told / DOUBT**2))


SWINGING = 6
"""Rounds after which a fit that has not come to rest is taken to swing."""
LAST = 4
"""Optima that are averaged."""


def between(path: Sequence[np.ndarray], z: np.ndarray, round_: int) -> np.ndarray:
    """Where to draw the next lines (unknowns,): at the last optimum ``z``, or between those of a fit that swings."""
    return np.asarray(np.mean(path[-LAST:], axis=0)) if round_ >= SWINGING and path else z


def swung(path: Sequence[np.ndarray], z: np.ndarray, round_: int) -> np.ndarray:
    """Covariance (unknowns, unknowns) about ``z`` of the last optima of a fit that still swings; zero before that."""
    if round_ < SWINGING or len(path) < 2:
        return np.zeros((len(z), len(z)))
    off = np.array(path[-LAST:]) - z
    return np.asarray(off.T @ off / len(off))


ASIDE = 1.5
"""How far from the mode the posterior is looked at [standard deviations by curvature]."""
FLAT = 0.05
"""A loss that rises less than this counts as having risen so much: what is flat is stretched to 4.7 times at most."""


def stretched(
    problem: Problem, z: np.ndarray, around: Linearisation, information: np.ndarray, slope: np.ndarray
) -> np.ndarray:
    """Covariance around a mode, shape (unknowns, unknowns), with the information by curvature given.

    ``slope`` (unknowns,) is that of log|S| / 2 (:mod:`.determinant`), which the loss of a round lacks: without
    it the mode would not be where the loss is least.

    Along each of its principal axes the loss is simulated on both sides. Where it rises less than the parabola, the
    axis is as long as the flatter side says; where it rises more, it stays: errors are not to be understated.
    """
    values, vectors = eigh(information)
    values = np.maximum(values, 1.0)  # the prior's, of which rounding may have left less
    low, high = problem.bounds
    mode = z

    def loss(z: np.ndarray) -> float:
        residual = problem.residuals(z, around)
        return 0.5 * float(residual @ residual + z @ z) + float(slope @ (z - mode))

    base, lengths = loss(z), values**-0.5
    for k, axis in enumerate(vectors.T):
        for side in (ASIDE, -ASIDE):
            step = np.clip(z + side * values[k] ** -0.5 * axis, low, high) - z
            size = float(np.linalg.norm(step))
            if size * values[k] ** 0.5 < 0.2 * ASIDE:  # at a bound
                continue
            try:
                rise = max(loss(z + step) - base, FLAT)
            except FAILURES:
                continue
            lengths[k] = max(lengths[k], size / np.sqrt(2 * rise))
    # nothing is less sure than before the recording
    return np.asarray((vectors * np.minimum(lengths, 1.0) ** 2) @ vectors.T)
