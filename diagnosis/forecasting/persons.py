"""Draws of what is not known about the inputs, for bands of a forecast.

Given the readings the nuisance is taken to be normal. Persons whom nobody counted are not: most hours of a night have
none. Drawn normally, and never fewer than none, they would be too many in hours to come, of which no reading tells. So
draws begin with courses of the description's own random occupancy, and each is corrected by what the readings say: with
``r`` the standardised residual at the prior mean, ``B`` the outputs by the unknowns, ``K`` the mean of the unknowns
given a residual, ``u`` a draw from the prior and ``e`` one of the errors,

    u + K (r - B u - e),

which has the posterior's mean and covariance where ``u`` has the prior's (conditioning by kriging; Chiles and Delfiner,
Geostatistics, section 7.3), and leaves hours that no reading tells of as they were drawn.
"""

from __future__ import annotations

import numpy as np

from diagnosis.fitting.linearisation import Marginal
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.unmeasured import courses


def from_the_prior(problem: Problem, draws: int, rng: np.random.Generator) -> np.ndarray:
    """Standard normal unknowns of the nuisance, shape (draws, unknowns).

    Those of persons whom nobody counted are such that their heights are a course of the description's.
    """
    nuisance = problem.nuisance
    found = rng.standard_normal((draws, nuisance.factor.shape[1]))
    for level in nuisance.levels:
        rows = nuisance.column == level.column
        columns = np.abs(nuisance.factor[rows]).any(axis=0)
        drawn = courses(problem.system, problem.drive).heights[:, : rows.sum()]  # those in the recording come first
        some = drawn[rng.integers(len(drawn), size=draws)] - nuisance.mean[rows]
        found[:, columns] = np.linalg.lstsq(nuisance.factor[np.ix_(rows, columns)], some.T, rcond=None)[0].T
    return found


def corrected(drawn: np.ndarray, likely: np.ndarray, marginal: Marginal, rng: np.random.Generator) -> np.ndarray:
    """A draw (unknowns,) given the readings, from one before them and the mean (unknowns,) that they leave."""
    outputs = marginal.by_unknown @ drawn
    return likely + drawn - marginal.unknowns(outputs + rng.standard_normal(len(outputs)))
