"""The space that a flow works in: the prior of the system description, as independent standard normal numbers.

A parameter's unit position is uniform on [0, 1] under its prior; the probit of that is standard normal. So a flow that
answers nothing answers the prior, and whatever it answers lies inside the ranges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import norm

from shared.system import System

EDGE = 1e-9
"""Unit positions are kept this far from 0 and 1, where the probit is infinite."""


@dataclass(frozen=True)
class Prior:
    """Ranges and scales of the parameters: ``low``, ``high`` (parameters,) [own units], ``log`` bool (parameters,)."""

    low: np.ndarray
    high: np.ndarray
    log: np.ndarray

    @classmethod
    def of(cls, system: System) -> Prior:
        """The prior of a system description."""
        each = system.parameters
        return cls(
            np.array([p.min for p in each]),
            np.array([p.max for p in each]),
            np.array([p.scale == "log" for p in each]),
        )

    def to_unit(self, parameters: np.ndarray) -> np.ndarray:
        """Unit positions of parameters (..., parameters) [own units]; outside [0, 1] where these leave their ranges."""
        linear = (parameters - self.low) / (self.high - self.low)
        low, width = self._logarithmic()
        logarithmic = np.log(np.where(self.log, np.maximum(parameters, 1e-300), 1.0) / low) / width
        return np.where(self.log, logarithmic, linear)

    def from_unit(self, unit: np.ndarray) -> np.ndarray:
        """Parameters (..., parameters) [own units] at unit positions; never outside their ranges."""
        linear = self.low + (self.high - self.low) * unit
        low, width = self._logarithmic()
        logarithmic = low * np.exp(width * unit)
        return np.clip(np.where(self.log, logarithmic, linear), self.low, self.high)

    def to_normal(self, parameters: np.ndarray, edge: float = EDGE) -> np.ndarray:
        """Parameters (..., parameters) [own units] as numbers that are standard normal under the prior, float64."""
        return np.asarray(ndtri(np.clip(self.to_unit(parameters), edge, 1 - edge)))

    def from_normal(self, z: np.ndarray) -> np.ndarray:
        """The inverse of :meth:`to_normal`."""
        return self.from_unit(ndtr(np.asarray(z, dtype=np.float64)))

    def log_jacobian(self, parameters: np.ndarray) -> np.ndarray:
        """Log of |d(standard normal numbers)/d(parameters)|, (...), from parameters (..., parameters) [own units]."""
        z = self.to_normal(parameters)
        return np.sum(self._log_slope(parameters) - norm.logpdf(z), axis=-1)

    def inside(self, parameters: np.ndarray) -> np.ndarray:
        """Whether parameters (..., parameters) lie in their ranges, bool (...)."""
        return np.all((parameters >= self.low) & (parameters <= self.high), axis=-1)

    def log_density(self, parameters: np.ndarray) -> np.ndarray:
        """Log density of the prior, (...), at parameters (..., parameters) [own units]."""
        return np.where(self.inside(parameters), np.sum(self._log_slope(parameters), axis=-1), -np.inf)

    def _logarithmic(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower ends and widths of the logarithmic ranges; ones in place of linear ones, which may begin below zero."""
        low, high = np.where(self.log, self.low, 1.0), np.where(self.log, self.high, np.e)
        return low, np.log(high / low)

    def _log_slope(self, parameters: np.ndarray) -> np.ndarray:
        """Log of d(unit position)/d(parameter), (..., parameters)."""
        _, width = self._logarithmic()
        widths = np.where(self.log, np.where(self.log, parameters, 1.0) * width, self.high - self.low)
        return np.asarray(-np.log(widths))
