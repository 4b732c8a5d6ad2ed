"""One round of a fit: bounded least squares of residual, prior and log determinant, the nuisance's covariance given."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from diagnosis.fitting.determinant import Determinant
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.problem import Problem

_HOPELESS = 1e3
"""Standardised residual of a simulation that failed."""


def solved(
    problem: Problem, z: np.ndarray, around: Linearisation, bent: Determinant | None, most: int
) -> tuple[np.ndarray, np.ndarray]:
    """The optimum with a given covariance, and the Jacobian of the residual there.

    Parameters
    ----------
    z
        Where to begin, shape (unknowns,).
    around
        What gives the residual its covariance.
    bent
        The log determinant as a parabola; without, it is taken for constant.
    most
        Evaluations at most.

    Returns
    -------
    tuple
        Unknowns (unknowns,) and the Jacobian (readings, unknowns).
    """
    low, high = problem.bounds
    inner = np.clip(z, low + 1e-6 * (high - low), high - 1e-6 * (high - low)) if np.isfinite(high - low).all() else z
    inner = np.where(np.isfinite(inner), inner, z)
    size = problem.size
    readings = int(problem.observed.sum())

    centre = np.zeros(size) if bent is None else -bent.slope
    rows = np.eye(size) if bent is None else np.vstack([np.eye(size), bent.root])

    def rest(z: np.ndarray) -> list[np.ndarray]:
        """Of the prior and the determinant: squares that add up to |z|^2 + log|S|, but for a constant."""
        return [z - centre] if bent is None else [z - centre, bent.root @ (z - bent.z)]

    def residual(z: np.ndarray) -> np.ndarray:
        try:
            found = problem.residuals(z, around)
        except FAILURES:
            found = np.full(readings, _HOPELESS)
        return np.concatenate([found, *rest(z)])

    places = list(problem.unknown.places_of_constants)
    held: list[np.ndarray] = []

    def jacobian(z: np.ndarray) -> np.ndarray:
        made = problem.jacobian(z, around, without=places if held else ())
        if not held:  # what constants do hardly changes on the way: once is enough
            held.append(made[:, places])
        made[:, places] = held[0]
        return np.vstack([made, rows])

    found = least_squares(residual, inner, jacobian, bounds=(low, high), max_nfev=most, ftol=1e-4, xtol=1e-4, gtol=1e-4)
    return found.x, found.jac[:readings]
