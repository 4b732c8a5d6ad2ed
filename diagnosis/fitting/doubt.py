"""How far a fit is believed: parameters also make up for what the model is not, and its own covariance knows no such.

Rooms of two opened blind checks without any effect, whose walls alone are finer than the model's, told what that takes:
of the 90 % intervals of ``diagnosis calibrate`` 70 % held the truth as the fit made them, 87 % with the doubt, and in
rooms whose walls are the model's own 91 and 98 % (persons counted). docs/measurements.md has all conditions.
"""

from __future__ import annotations

import numpy as np

DOUBT = 2.0
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
