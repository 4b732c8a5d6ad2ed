"""One p-value for thousands of cells: the largest studentised statistic, against the twins' largest.

The idea of a statistic per cell and one Monte-Carlo p for all is that of Anau Montel, Alvey and Weniger (2024, arXiv
2412.15100); the single-step adjusted p of a cell is that of Westfall and Young (1993, Resampling-Based Multiple
Testing, section 2.3). Ranks among exchangeable rows are exact for any number of cells, however they depend on one
another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class MaxTest:
    """Result of :func:`max_test`.

    ``observed``, ``typical``, ``spread`` and ``t`` (cells,): the recording's statistic, mean and standard deviation of
    the twins', and their studentised difference. ``adjusted`` (cells,): family-wise p of each cell, 1 where the
    cell took no part. ``upper`` (cells,): of which cells only large values count. ``maxima`` (B + 1,): the largest
    statistic of each row, the recording's first.
    """

    observed: np.ndarray
    typical: np.ndarray
    spread: np.ndarray
    t: np.ndarray
    adjusted: np.ndarray
    kept: np.ndarray
    maxima: np.ndarray
    upper: np.ndarray

    @property
    def p_value(self) -> float:
        """Family-wise p of the recording."""
        return float(rank_p(self.maxima[:1], self.maxima[1:])[0])

    def restudentise(self, statistics: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Studentised value and adjusted p of other statistics (cells,) of the recording, against the same twins."""
        with np.errstate(invalid="ignore", divide="ignore"):
            t = np.where(self.kept, (statistics - self.typical) / self.spread, np.nan)
        return t, _adjusted(t, self.maxima, self.kept, self.upper)

    def level(self, alpha: float = 0.05) -> float:
        """Studentised value beyond which a cell is significant at ``alpha``, whichever it is."""
        return float(np.quantile(self.maxima[1:], 1 - alpha, method="higher"))


def rank_p(observed: np.ndarray, twins: np.ndarray) -> np.ndarray:
    """Monte-Carlo p, (1 + twins at or above) / (B + 1) (Davison and Hinkley 1997, section 4.2), like ``observed``."""
    above = len(twins) - np.searchsorted(np.sort(twins), observed, side="left")
    return (1 + above) / (len(twins) + 1)


def studentise(statistics: np.ndarray) -> np.ndarray:
    """Each row against mean and standard deviation of all the others; shape (rows, cells) in and out.

    Every row, the recording's too, is left out of its own yardstick: that treats rows alike, which makes ranks exact.
    """
    rows = len(statistics)
    apart = statistics - statistics.mean(axis=0)
    total = np.einsum("ij,ij->j", apart, apart)
    # in place: there are tens of millions of these numbers
    others = apart**2
    others *= -(rows / (rows - 1))
    others += total
    np.maximum(others, 1e-12 * total, out=others)
    np.sqrt(others, out=others)
    apart *= rows / (rows - 1) * np.sqrt(rows - 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        apart /= others
    return apart


def max_test(statistics: np.ndarray, upper: bool | np.ndarray = False) -> MaxTest:
    """Test all cells at once.

    Parameters
    ----------
    statistics
        Shape (B + 1, cells); the recording first. A cell that is not finite in some row, or the same in all, takes no
        part.
    upper
        Whether only large values count, of all cells or of each (cells,).
    """
    statistics = np.asarray(statistics, dtype=float)
    observed, kept = statistics[0], np.isfinite(statistics).all(axis=0)
    used = statistics[:, kept]
    least, most = (used.min(axis=0), used.max(axis=0)) if used.size else (np.empty(0), np.empty(0))
    moved = most - least > 1e-12 * np.maximum(most, -least)
    kept[kept] = moved
    used, reach = (used if moved.all() else used[:, moved]), (most - least)[moved]
    cells = statistics.shape[1]
    one_sided = np.broadcast_to(np.asarray(upper, dtype=bool), (cells,))
    typical, spread, t = (np.full(cells, np.nan) for _ in range(3))
    maxima = np.full(len(statistics), -np.inf)
    if kept.any():
        typical[kept] = used[1:].mean(axis=0)
        # twins that all agree still have a floor below them, or a cell would be infinitely significant
        spread[kept] = np.maximum(used[1:].std(axis=0, ddof=1), 1e-6 * reach)
        rows = studentise(used)
        t[kept] = rows[0]
        small = rows.min(axis=1, where=~one_sided[kept], initial=np.inf)
        maxima = np.maximum(rows.max(axis=1), -small)
    return MaxTest(observed, typical, spread, t, _adjusted(t, maxima, kept, one_sided), kept, maxima, one_sided)


def _adjusted(t: np.ndarray, maxima: np.ndarray, kept: np.ndarray, upper: np.ndarray) -> np.ndarray:
    size = np.where(kept, np.where(upper, t, np.abs(t)), -np.inf)
    return np.where(kept, rank_p(size, maxima[1:]), 1.0)


def combine(tests: Sequence[MaxTest]) -> MaxTest:
    """One test of several families: their maxima, each studentised, are the cells of one more.

    Exact for the same reason as each family is; the combined adjusted p is that of a family as a whole.
    """
    used = np.stack([test.maxima for test in tests], axis=1)
    return max_test(np.where(np.isfinite(used), used, 0.0), upper=True)
