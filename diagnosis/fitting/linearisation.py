"""The simulation around a point, as far as a nuisance is concerned: a straight line, and the nuisance integrated out.

Where many unknowns move few readings, most of their directions move nothing: :func:`principal` keeps the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh


def principal(columns: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thin singular value decomposition of columns (rows, n), from the smaller of its two products.

    Parameters
    ----------
    least
        Squared length from which a direction is kept.

    Returns
    -------
    tuple
        Squared lengths (k,), increasing, directions among the columns (n, k) and among the rows (rows, k), both
        orthonormal.
    """
    rows, count = columns.shape
    if not columns.size:
        return np.empty(0), np.empty((count, 0)), np.empty((rows, 0))
    wide = count > rows
    # all vectors are asked for, which divide and conquer gives fastest
    values, vectors = eigh(columns @ columns.T if wide else columns.T @ columns, driver="evd")
    keep = values > least
    values, vectors = values[keep], vectors[:, keep]
    scaled = vectors / np.sqrt(values)
    return (values, columns.T @ scaled, vectors) if wide else (values, vectors, columns @ scaled)


UNFELT = 1e-6
"""Eigenvalue up to which a direction is left out."""


class Marginal:
    """Standardised residuals with the nuisance integrated out.

    With iid N(0, 1) errors and ``by_unknown`` (rows, unknowns) the standardised outputs by standard normal unknowns,
    the covariance of the residual is S = I + B B'. :meth:`root` applies S^(-1/2).
    """

    def __init__(self, by_unknown: np.ndarray | Callable[[], np.ndarray]) -> None:
        """``by_unknown`` may be a function that gives it: it is asked when it is first needed."""
        self._given = by_unknown

    @cached_property
    def by_unknown(self) -> np.ndarray:
        """B, shape (rows, unknowns)."""
        return self._given() if callable(self._given) else self._given

    @cached_property
    def _decomposed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Eigenvalues and vectors of B'B, and an orthonormal basis of B; made when first asked for."""
        return principal(self.by_unknown, UNFELT)

    @property
    def _values(self) -> np.ndarray:
        return self._decomposed[0]

    @property
    def _vectors(self) -> np.ndarray:
        return self._decomposed[1]

    @property
    def _basis(self) -> np.ndarray:
        return self._decomposed[2]

    @property
    def logdet(self) -> float:
        """Of S."""
        return float(np.sum(np.log1p(self._values)))

    def root(self, rows: np.ndarray) -> np.ndarray:
        """S^(-1/2) applied to standardised rows, shape (rows,) or (rows, n)."""
        inside = self._basis.T @ rows
        shrink = 1 - 1 / np.sqrt(1 + self._values)
        return np.asarray(rows - self._basis @ (shrink * inside.T).T)

    def unknowns(self, residual: np.ndarray) -> np.ndarray:
        """Posterior mean of the unknowns given a standardised residual (rows,), shape (unknowns,)."""
        projected = self._vectors.T @ (self.by_unknown.T @ residual)
        return np.asarray(self._vectors @ (projected / (1 + self._values)))

    def inverse(self, rows: np.ndarray) -> np.ndarray:
        """S^(-1) applied to standardised rows, shape (rows,) or (rows, n)."""
        inside = self._basis.T @ rows
        shrink = self._values / (1 + self._values)
        return np.asarray(rows - self._basis @ (shrink * inside.T).T)


@dataclass(frozen=True)
class Linearisation:
    """The simulation around some unknowns and a nuisance.

    ``z`` (unknowns,); ``nuisance`` standard normal, shape (nuisance unknowns,), and its ``heights`` (pulses,);
    ``outputs`` (outputs, steps) simulated with both; ``response`` (outputs, steps, pulses) by heights [unit of output
    per unit of input]; ``marginal`` integrates the nuisance out of standardised rows of observed readings; pulses that
    turn were followed for ``lasting`` [s] at most.
    """

    z: np.ndarray
    nuisance: np.ndarray
    heights: np.ndarray
    outputs: np.ndarray
    response: np.ndarray
    marginal: Marginal
    lasting: float = np.inf
