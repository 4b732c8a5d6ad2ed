"""How far a fit is believed: parameters also make up for what the model is not, and its own covariance knows no such.

What a model takes for granted is among the unknowns (:mod:`diagnosis.fitting.unknowns`), but not all of it: weather
that was read with an error, noise that is slower than it looks. Rooms of an opened blind check without an effect, whose
walls are finer than the model's, told what that takes: the fit's own standard deviations were too small by 1.6 where
persons were counted, by 1.2 in replay. docs/measurements.md has all conditions.
"""

from __future__ import annotations

import numpy as np

DOUBT = 1.5
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
