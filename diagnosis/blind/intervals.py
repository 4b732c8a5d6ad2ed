"""Figures with their intervals: shares by Wilson's score interval, other means by a bootstrap of recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict
from scipy.special import ndtri

from shared import metrics

LEVEL = 0.95
DRAWS = 2000
FEW = 10
"""Of fewer recordings a bootstrap's interval is too narrow: what they do not hold is never drawn."""
Statistic = Callable[[np.ndarray], np.ndarray]


class Share(BaseModel):
    """``hits`` of ``n``, with the 95 % interval of Wilson (1927, J. Am. Stat. Assoc. 22:209); empty where n is 0."""

    model_config = ConfigDict(extra="forbid")
    hits: int
    n: int
    value: float | None
    low: float | None
    high: float | None


class Figure(BaseModel):
    """A statistic of ``n`` recordings with its 95 % percentile bootstrap interval; empty where n is 0.

    One recording says nothing of how others would be: its figure has no interval.
    """

    model_config = ConfigDict(extra="forbid")
    n: int
    value: float | None
    low: float | None
    high: float | None


def share(hits: Sequence[bool] | np.ndarray) -> Share:
    """The share of hits."""
    n, k = len(hits), int(np.sum(hits))
    if n == 0:
        return Share(hits=0, n=0, value=None, low=None, high=None)
    low, high = wilson(k / n, n)
    return Share(hits=k, n=n, value=k / n, low=low, high=high)


def wilson(value: float, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share of n."""
    low, high = metrics.wilson(value, n, float(ndtri((1 + LEVEL) / 2)))
    return float(low), float(high)


def mean(rows: np.ndarray) -> np.ndarray:
    """Mean over recordings, shape (draws,) of (draws, n)."""
    return np.asarray(rows.mean(axis=1))


def median(rows: np.ndarray) -> np.ndarray:
    """Median over recordings, shape (draws,) of (draws, n)."""
    return np.asarray(np.median(rows, axis=1))


def figure(values: np.ndarray, statistic: Statistic = mean, *, seed: int = 0, draws: int = DRAWS) -> Figure:
    """A statistic of rows, one for each recording, shape (n,) or (n, columns).

    Parameters
    ----------
    statistic
        Of many draws of rows with replacement at once: (draws, n[, columns]) to (draws,).
    """
    values = np.asarray(values, dtype=float)
    n = len(values)
    if n == 0:
        return Figure(n=0, value=None, low=None, high=None)
    value = float(statistic(values[None])[0])
    if n == 1:
        return Figure(n=1, value=value, low=None, high=None)
    drawn = statistic(values[np.random.default_rng(seed).integers(0, n, (draws, n))])
    low, high = np.nanquantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Figure(n=n, value=value, low=float(low), high=float(high))
