"""How the covariance of a residual depends on the unknowns: the part of a marginal likelihood that a line leaves out.

With the nuisance integrated out the residual's covariance is S = 1 + B B', and B, the answer of the outputs to it,
depends on the unknowns. A fit on one line holds B fixed. Of the likelihood's log|S| / 2 it lacks the slope tr(M_k) by
unknown z_k, with M_k = B' S^-1 dB/dz_k, and of the expected information tr(M_k M_l) (Fisher information of a Gaussian
with mean and covariance: Mardia and Marshall 1984, Biometrika 71, 135-146); the rest of it is in the derivative of the
outputs at the most likely nuisance. Without them an air volume comes out too small: a smaller room follows persons
faster, and can make more of what is not known of when they came.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from scipy.linalg import cho_solve, eigh

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.gaussian import Parabola
from diagnosis.fitting.grams import Colour, Grams
from diagnosis.fitting.linear import responses

WIDTH = 0.2
"""Of the difference in an unknown [prior standard deviations]."""


def determinant(grams: Grams, colours: dict[int, Colour]) -> Parabola:
    """log|S| / 2 near where a line was drawn; the answers to the nuisance are simulated beside it for each unknown.

    Only pulses within the recording count: how the answer to what came before it depends on unknowns does not matter.
    An unknown whose simulations fail on both sides is taken to change nothing, and so is an uncertain constant, which
    changes little.
    """
    lin, problem, size = grams.lin, grams.lin.problem, grams.n_unknown
    around, within = lin.around, problem.nuisance.recorded
    if not within.any():
        return Parabola(lin.z, np.zeros(size), np.zeros((size, size)))
    some = problem.nuisance.only(within).shortened(around.lasting)  # as long as those they are compared with

    def answer(z: np.ndarray) -> np.ndarray:
        def simulate(pulses: list[np.ndarray]) -> list[np.ndarray]:
            cases = []
            for one in pulses:
                heights = around.heights.copy()
                heights[within] += one
                cases.append((z, heights))
            return problem.simulate_all(cases)

        return responses(some, simulate, problem.simulate(z, around.heights), problem.time)

    low, high = problem.bounds
    root = grams.without_nuisance(colours).root
    white = {k: grams.whitened_columns(k, colours[k])[:, : grams.n_nuisance] for k in grams.channels}
    made = [np.zeros_like(root)] * size
    for k in sorted({*range(size)} - {*problem.unknown.places_of_constants}):
        change = np.zeros_like(around.response)
        for way in (WIDTH, -WIDTH):
            z = lin.z.copy()
            z[k] += way
            if not low[k] <= z[k] <= high[k]:
                continue
            with suppress(*FAILURES):
                change[:, :, within] = (answer(z) - around.response[:, :, within]) / way
                break
        turned = problem.nuisance.by_unknown(change, problem.observed.any(axis=1)) @ lin.turn
        across = sum(white[c].T @ grams.whitened(c, colours[c], turned[c]) for c in grams.channels)
        made[k] = cho_solve((root, True), across)
    flat = np.stack([one.ravel() for one in made])
    gained = flat @ np.stack([one.T.ravel() for one in made]).T
    values, vectors = eigh(0.5 * (gained + gained.T))
    return Parabola(lin.z, np.array([np.trace(one) for one in made]), (vectors * np.maximum(values, 0.0)) @ vectors.T)
