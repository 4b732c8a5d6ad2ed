"""A posterior that is no parabola: its spread by simulations, not by curvature at the mode alone."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.problem import Problem

WIDTH = 1.5
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
        for side in (WIDTH, -WIDTH):
            step = np.clip(z + side * values[k] ** -0.5 * axis, low, high) - z
            size = float(np.linalg.norm(step))
            if size * values[k] ** 0.5 < 0.2 * WIDTH:  # at a bound
                continue
            try:
                rise = max(loss(z + step) - base, FLAT)
            except FAILURES:
                continue
            lengths[k] = max(lengths[k], size / np.sqrt(2 * rise))
    # nothing is less sure than before the recording
    return np.asarray((vectors * np.minimum(lengths, 1.0) ** 2) @ vectors.T)
