"""A series that would explain the residuals, by regularised inversion, and how much better it explains them than noise.

With white unit noise e = G u + noise and a prior u ~ N(0, tau K), K an Ornstein-Uhlenbeck covariance, the posterior
mean is the Tikhonov (or Kalman-smoother) solution, and the marginal likelihood has a closed form in the eigenbasis of
the whitened Gram matrix (Rasmussen and Williams 2006, Gaussian Processes for Machine Learning, sections 2.1 and 5.4).
One decomposition serves all rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_GRID = np.concatenate([[0.0], np.logspace(-2, 8, 41)])
"""Prior variances tried, relative to the one at which the best-seen direction has a signal-to-noise ratio of 1."""


@dataclass(frozen=True)
class Inverse:
    """A decomposed inverse problem with pulses ``root`` @ ``vectors`` and coefficients of the rows in that basis.

    ``strength`` (pulses,): squared singular values; ``projected`` (rows, pulses): rows in the basis, times the singular
    values.
    """

    root: np.ndarray
    vectors: np.ndarray
    strength: np.ndarray
    projected: np.ndarray

    @property
    def unit(self) -> float:
        """Prior variance at which the best-seen direction has a signal-to-noise ratio of 1."""
        return 1 / float(self.strength.max()) if self.strength.max() > 0 else 0.0

    def gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Log marginal likelihood of each row over that of mere noise, at its best prior variance: both (rows,)."""
        grid = _GRID * self.unit
        best, at = np.zeros(len(self.projected)), np.zeros(len(self.projected))
        for tau in grid[1:]:
            ratio = tau / (1 + tau * self.strength)
            gain = 0.5 * (self.projected**2 @ ratio - np.log1p(tau * self.strength).sum())
            better = gain > best
            best, at = np.where(better, gain, best), np.where(better, tau, at)
        return best, at

    def solve(self, tau: float) -> np.ndarray:
        """Posterior means of all rows at one prior variance, shape (rows, pulses)."""
        return (self.projected * (tau / (1 + tau * self.strength))) @ (self.root @ self.vectors).T

    def uncertainty(self, tau: float) -> np.ndarray:
        """Posterior standard deviation of each pulse, shape (pulses,)."""
        basis = self.root @ self.vectors
        return np.sqrt(np.einsum("ij,j,ij->i", basis, tau / (1 + tau * self.strength), basis))

    def tau_for(self, share: float) -> float:
        """Prior variance at which the solution has ``share`` of its degrees of freedom, sum tau s / (1 + tau s)."""
        target = share * np.count_nonzero(self.strength > 1e-10 * self.strength.max())
        low, high = -10.0, 14.0
        for _ in range(60):
            middle = (low + high) / 2
            tau = 10**middle * self.unit
            if (tau * self.strength / (1 + tau * self.strength)).sum() < target:
                low = middle
            else:
                high = middle
        return float(10**low * self.unit)


def decompose(rows: np.ndarray, response: np.ndarray, centres: np.ndarray, memory: float) -> Inverse:
    """Prepare an inversion.

    Parameters
    ----------
    rows
        Whitened residuals, shape (rows, readings).
    response
        Whitened response to unit pulses, shape (readings, pulses).
    centres
        Middle of each pulse [s].
    memory
        Time over which the series remembers itself [s]; 0 for pulses that know nothing of one another.
    """
    if memory > 0:
        covariance = np.exp(-np.abs(centres[:, None] - centres) / memory)
        root = np.linalg.cholesky(covariance + 1e-10 * np.eye(len(centres)))
        driven = response @ root
    else:
        root, driven = np.eye(len(centres)), response
    strength, vectors = np.linalg.eigh(driven.T @ driven)
    strength = np.maximum(strength, 0.0)
    strength[strength < 1e-12 * strength.max(initial=0.0)] = 0.0
    return Inverse(root, vectors, strength, rows @ driven @ vectors)
