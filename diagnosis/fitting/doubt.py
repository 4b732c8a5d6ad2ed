"""How far a fit is believed: parameters also make up for what the model is not, and its own covariance knows no such.

Rooms of the blind check without any effect, whose walls alone are finer than the model's, told what that takes: of the
90 % intervals of ``diagnosis calibrate`` with counted persons and simulated controllers 59 % held the truth, of those
with standard deviations from the recording twice as large 91 % (docs/measurements.md has all conditions).
"""

from __future__ import annotations

import numpy as np

DOUBT = 2.0
"""A recording's information on the unknowns counts for 1 / DOUBT^2: its standard deviations are so much larger."""


def doubted(covariance: np.ndarray) -> np.ndarray:
    """Covariance (unknowns, unknowns) of a posterior whose prior is standard normal, its recording doubted."""
    prior = np.eye(len(covariance))
    return np.asarray(np.linalg.inv(prior + (np.linalg.inv(covariance) - prior) / DOUBT**2))


def doubted_sd(sd: np.ndarray) -> np.ndarray:
    """Standard deviations (unknowns,) of such a posterior, each by itself: the prior keeps its say."""
    told = np.maximum(np.asarray(sd) ** -2.0 - 1.0, 0.0)
    return np.asarray(1.0 / np.sqrt(1.0 + told / DOUBT**2))
