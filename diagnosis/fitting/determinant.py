"""How the covariance of a residual depends on the unknowns: the part of a marginal likelihood that a mode lacks.

With the nuisance integrated out the residual's covariance is S = I + B B', and B, the answer of the outputs to it,
depends on the unknowns. Of the likelihood's log|S| / 2 this gives the gradient tr(M_k), with M_k = B' S^-1 dB/dz_k,
and tr(M_k M_l), by which the expected information exceeds that of the residual's mean alone (Fisher information of a
Gaussian with mean and covariance: Mardia and Marshall 1984, Biometrika 71, 135-146). Without it an air volume comes out
too small: a smaller room follows persons faster, and can make more of what is not known of when they came.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from diagnosis.fitting.answers import responses
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.problem import Problem

WIDTH = 0.2
"""Of the difference in an unknown [prior standard deviations]."""


@dataclass(frozen=True)
class Determinant:
    """What log|S| / 2 is near a point.

    At ``z`` (unknowns,): its ``slope`` (unknowns,), and a ``root`` R (unknowns, unknowns) of what the information gains
    by it, which is R' R.
    """

    z: np.ndarray
    slope: np.ndarray
    root: np.ndarray


def determinant(problem: Problem, around: Linearisation) -> Determinant:
    """Simulate the answers to the nuisance beside ``around``, for each unknown.

    Only pulses within the recording count: how the answer to what came before it depends on unknowns does not matter.
    An unknown whose simulations fail on both sides is taken to change nothing.
    """
    size = problem.size
    within = problem.nuisance.recorded
    if not within.any():
        return Determinant(around.z, np.zeros(size), np.zeros((size, size)))
    some = problem.nuisance.only(within).shortened(around.lasting)  # as long as those they are compared with
    weight = around.marginal.inverse(around.marginal.by_unknown).T
    wide = weight.shape[0] > weight.shape[1]
    low, high = problem.bounds

    def answer(z: np.ndarray) -> np.ndarray:
        def simulate(pulses: list[np.ndarray]) -> list[np.ndarray]:
            cases = []
            for one in pulses:
                heights = around.heights.copy()
                heights[within] += one
                cases.append((z, heights))
            return problem.simulate_all(cases)

        return responses(some, simulate, problem.simulate(z, around.heights), problem.time)

    products = []
    for k in range(size):
        change = np.zeros_like(around.response)
        for way in (WIDTH, -WIDTH):
            z = around.z.copy()
            z[k] += way
            if not low[k] <= z[k] <= high[k]:
                continue
            with suppress(*FAILURES):
                change[:, :, within] = (answer(z) - around.response[:, :, within]) / way
                break
        derivative = problem.standardised(problem.nuisance.by_unknown(change))
        # traces of products are the same whichever factor comes first: of two, the smaller matrix
        products.append(derivative @ weight if wide else weight @ derivative)
    flat = np.stack([one.ravel() for one in products])
    gained = flat @ np.stack([one.T.ravel() for one in products]).T
    values, vectors = eigh(0.5 * (gained + gained.T))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return Determinant(around.z, np.array([np.trace(one) for one in products]), root)
