"""Scores of distributions against the truth, by samples.

Simulation-based calibration: Talts et al., 2018, Validating Bayesian inference algorithms with simulation-based
calibration, arXiv:1804.06788. CRPS: Gneiting and Raftery, 2007, Strictly proper scoring rules, section 4.2.
"""

from __future__ import annotations

import numpy as np
from scipy import stats
from scipy.special import ndtr, ndtri

BINS = 20
"""Of a rank histogram, where there are systems enough."""
PER_BIN = 10
"""Systems that a bin should expect at least."""
FEWEST = 4
"""Bins that a rank histogram has at least: in two, a posterior far too narrow or too wide is flat."""


def positions(truth: np.ndarray, samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Where the truth (windows, parameters) lies among samples (windows, n, parameters): the rank, as a share.

    It is drawn within its step of 1 / (n + 1), so that it is uniform on [0, 1] where truth and samples are drawn alike.
    """
    rank = (samples < truth[:, None]).sum(axis=1)
    return (rank + rng.random(rank.shape)) / (samples.shape[1] + 1)


def covered(position: np.ndarray, level: float) -> np.ndarray:
    """Whether the central interval of a level holds the truth, from its :func:`positions`; bool, same shape."""
    return np.abs(position - 0.5) <= level / 2


def bins_for(systems: int) -> int:
    """Bins of a rank histogram of so many systems; 0 where they are too few for one."""
    bins = min(systems // PER_BIN, BINS)
    return bins if bins >= FEWEST else 0


def uniformity(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P values, (parameters,) each, of positions (systems, parameters) being uniform: chi-squared, Kolmogorov-Smirnov.

    The rows must be independent: one window of each system. Where they are too few for a histogram, the former is NaN.
    """
    bins = bins_for(len(position))
    kolmogorov = np.array([stats.kstest(column, "uniform").pvalue for column in position.T])
    if not bins:
        return np.full(position.shape[1], np.nan), kolmogorov
    counts = np.stack([np.histogram(column, bins, (0, 1))[0] for column in position.T])
    return np.asarray(stats.chisquare(counts, axis=1).pvalue), kolmogorov


def crps(truth: np.ndarray, samples: np.ndarray, *, quantiles: bool = False) -> np.ndarray:
    """Continuous ranked probability score (windows, parameters) [own units]; smaller is better.

    Mean distance of the samples from the truth, less half their mean distance from each other; the latter is a sum over
    the sorted samples. Of samples that are drawn it is the mean over pairs of two different ones, so that few do not
    score worse than many of the same distribution (Ferro, 2014, Fair scores for ensemble forecasts, equation 8);
    quantiles of a distribution are taken for all of it.
    """
    n = samples.shape[1]
    weights = (2 * np.arange(1, n + 1) - n - 1) / (n**2 if quantiles else n * (n - 1))
    spread = np.einsum("n,wnp->wp", weights, np.sort(samples, axis=1))
    return np.asarray(np.abs(samples - truth[:, None]).mean(axis=1) - spread)


def truncated_normal(
    middle: np.ndarray, sd: np.ndarray, low: np.ndarray, high: np.ndarray, truth: np.ndarray, n: int
) -> tuple[np.ndarray, np.ndarray]:
    """What one would say without a posterior: the estimate, and the same error for every window, within the ranges.

    Returns n quantiles (windows, n, parameters) of the distribution, and its log density (windows,) at the truth.
    """
    sd = np.maximum(sd, 1e-12 * (high - low))
    below, above = ndtr((low - middle) / sd), ndtr((high - middle) / sd)
    levels = ((np.arange(n) + 0.5) / n)[:, None]
    quantiles = middle[:, None] + sd * ndtri(below[:, None] + levels * (above - below)[:, None])
    density = stats.norm.logpdf(truth, middle, sd) - np.log(above - below)
    return quantiles, np.asarray(density.sum(axis=1))
