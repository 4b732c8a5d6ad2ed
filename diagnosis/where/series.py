"""Residuals of the recording on top of those of its twins: what every test of this package reads.

One p-value for thousands of cells: the largest studentised statistic, against the twins' largest.

The idea of a statistic per cell and one Monte-Carlo p for all is that of Anau Montel, Alvey and Weniger (2024, arXiv
2412.15100); the single-step adjusted p of a cell is that of Westfall and Young (1993, Resampling-Based Multiple
Testing, section 2.3). Ranks among exchangeable rows are exact for any number of cells, however they depend on one
another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.ndimage import gaussian_filter1d

HOUR = 3600.0
DAY = 24 * HOUR
ALPHA = 0.05
"""Family-wise level of what is reported."""
FEWEST = 4
"""Steps of the shortest recording that can be looked at."""


@dataclass(frozen=True)
class Residuals:
    """Measured minus simulated outputs of the calibrated model, and the same of its twins.

    The twins are the null: the whole pipeline (simulate, add noise, calibrate, subtract) run on recordings that the
    model itself made. They must have been recalibrated: residuals at the true parameters are wider and smoother.

    Parameters
    ----------
    time
        Ends of the steps [s since time zero of the year, local standard time], shape (steps,), regular.
    observed
        Residuals of the recording [unit of each output], shape (outputs, steps); NaN where nothing was measured.
    replicates
        Residuals of the twins, shape (B, outputs, steps); NaN where a twin's reading was lost.
    names, units, labels
        Of the outputs; ``labels`` are what a reader sees (the names, when left out).
    """

    time: np.ndarray
    observed: np.ndarray
    replicates: np.ndarray
    names: Sequence[str]
    units: Sequence[str]
    labels: Sequence[str] = field(default=())

    def __post_init__(self) -> None:
        if not self.labels:
            object.__setattr__(self, "labels", tuple(self.names))

    @property
    def step(self) -> float:
        """Length of a step [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def middle(self) -> np.ndarray:
        """Middle of each step [s], shape (steps,): decides hour and day."""
        return self.time - self.step / 2

    @property
    def hour(self) -> np.ndarray:
        """Hour of the day [h], shape (steps,)."""
        return self.middle % DAY / HOUR

    @property
    def day(self) -> np.ndarray:
        """Number of the day since time zero, shape (steps,)."""
        return np.floor(self.middle / DAY).astype(int)

    @property
    def weekend(self) -> np.ndarray:
        """Whether a step lies on Saturday or Sunday, shape (steps,)."""
        return self.day % 7 >= 5

    @cached_property
    def stacked(self) -> np.ndarray:
        """Recording first, then the twins, shape (B + 1, outputs, steps).

        What the recording lacks is blanked in the twins too, so that under the null all rows are exchangeable.
        """
        blank = ~np.isfinite(self.observed)
        twins = np.where(blank[None] | ~np.isfinite(self.replicates), np.nan, self.replicates)
        return np.concatenate([np.where(blank, np.nan, self.observed)[None], twins])

    @property
    def measured(self) -> list[int]:
        """Outputs of which the recording has anything."""
        return [k for k in range(len(self.names)) if np.isfinite(self.observed[k]).any()]


@dataclass(frozen=True)
class Whitened:
    """``rows`` (B + 1, readings): every channel's innovations over their standard deviation, one after the other.

    Use :meth:`response` for anything that is to explain them.
    """

    rows: np.ndarray
    channels: list[int]
    colours: list[np.ndarray]
    scales: list[float]
    blank: np.ndarray

    def response(self, responses: np.ndarray) -> np.ndarray:
        """Responses (outputs, steps, columns) as the same linear map makes them, shape (readings, columns)."""
        parts = []
        for k, colour, scale in zip(self.channels, self.colours, self.scales, strict=True):
            series = np.where(self.blank[k], np.nan, responses[k].T)
            parts.append((whiten(fill(series), colour) / scale)[:, _used(self.blank[k], colour)])
        return np.concatenate(parts, axis=1).T


def whitened(residuals: Residuals) -> Whitened:
    """Prewhiten recording and twins alike."""
    stack = residuals.stacked
    channels, colours, scales, parts = [], [], [], []
    blank = ~np.isfinite(residuals.observed)
    for k in residuals.measured:
        colour = fit_colour(stack[:, k])
        used = _used(blank[k], colour)
        part = whiten(fill(stack[:, k]), colour)[:, used]
        scale = float(part.std()) if used.any() else 0.0
        if scale > 0:
            channels.append(k)
            colours.append(colour)
            scales.append(scale)
            parts.append(part / scale)
    return Whitened(np.concatenate(parts, axis=1), channels, colours, scales, blank)


def _used(blank: np.ndarray, colour: np.ndarray) -> np.ndarray:
    return ~blank & (np.arange(len(blank)) >= len(colour))


ORDER = 3


def fill(values: np.ndarray) -> np.ndarray:
    """Join what is there across gaps by straight lines, level at the ends; linear in the values; shape (..., steps)."""
    steps = np.arange(values.shape[-1])
    flat = values.reshape(-1, values.shape[-1]).copy()
    for row in flat:
        seen = np.isfinite(row)
        if not seen.all():
            row[~seen] = np.interp(steps[~seen], steps[seen], row[seen]) if seen.any() else 0.0
    return flat.reshape(values.shape)


def fit_colour(values: np.ndarray, order: int = ORDER) -> np.ndarray:
    """Coefficients of an autoregression by the Yule-Walker equations, pooled over rows (Box and Jenkins, section 3.2).

    Parameters
    ----------
    values
        Shape (rows, steps); NaN where missing: products of which a factor is missing are left out.

    Returns
    -------
    numpy.ndarray
        Shape (order,). All rows count alike, so that filtered rows stay exchangeable.
    """
    seen = np.isfinite(values)
    count = seen.sum(axis=1, keepdims=True)
    mean = np.where(seen, values, 0.0).sum(axis=1, keepdims=True) / np.maximum(count, 1)
    apart = np.where(seen, values - mean, 0.0)
    steps = values.shape[1]
    covariance = np.zeros(order + 1)
    for lag in range(order + 1):
        pairs = (seen[:, lag:] & seen[:, : steps - lag]).sum()
        # dividing by pairs at each lag and shrinking by the usual (steps - lag) / steps keeps the sequence definite
        covariance[lag] = np.sum(apart[:, lag:] * apart[:, : steps - lag]) / max(pairs, 1) * (steps - lag) / steps
    if covariance[0] <= 0:
        return np.zeros(order)
    covariance[0] *= 1 + 1e-6
    return np.asarray(solve_toeplitz(covariance[:-1], covariance[1:]))


def whiten(values: np.ndarray, colour: np.ndarray) -> np.ndarray:
    """What the autoregression does not foresee; the first ``len(colour)`` steps are NaN; shape (..., steps)."""
    found = values.astype(float).copy()
    for lag, weight in enumerate(colour, start=1):
        found[..., lag:] -= weight * values[..., :-lag]
    found[..., : len(colour)] = np.nan
    return found


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

    @property
    def level(self) -> float:
        """Studentised value beyond which a cell is significant, whichever it is."""
        return float(np.quantile(self.maxima[1:], 1 - ALPHA, method="higher"))


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


WHOLE = "all"
EDGES = {"slow": 48 * HOUR, "diurnal": 9 * HOUR, "hours": 3 * HOUR, "fast": 0.0}
"""Shortest period of each band [s]; at an edge a band passes half the amplitude. The 12-hour harmonic is diurnal."""
MEANING = {
    WHOLE: "all periods",
    "slow": "periods of more than 2 days",
    "diurnal": "periods of 9 hours to 2 days",
    "hours": "periods of 3 to 9 hours",
    "fast": "periods of less than 3 hours",
}
BRIEF = {WHOLE: "all", "slow": "> 2 d", "diurnal": "9 h-2 d", "hours": "3-9 h", "fast": "< 3 h"}


def band_names(step: float, steps: int) -> list[str]:
    """Bands that a record of ``steps`` steps of ``step`` seconds can show, with the whole first."""
    edges = [name for name, edge in EDGES.items() if 2 * step < edge < step * steps / 2]
    names = [WHOLE, *edges]
    rest = list(EDGES)[list(EDGES).index(edges[-1]) + 1] if edges else None
    if rest is not None:
        names.append(rest)
    return names


def split(values: np.ndarray, step: float) -> dict[str, np.ndarray]:
    """Split series into bands by differences of Gaussian averages over what is there.

    A Gaussian of standard deviation P sqrt(2 ln 2) / (2 pi) halves the amplitude at period P (its frequency response
    is exp(-(2 pi sigma / P)^2 / 2)).

    Parameters
    ----------
    values
        Shape (..., steps); NaN where missing. Averages skip it and it stays missing in every band.
    step
        [s]

    Returns
    -------
    dict
        By band, each shaped like ``values``; ``all`` is the values themselves, the others add up to them.
    """
    seen = np.isfinite(values)
    filled, weight = np.where(seen, values, 0.0), seen.astype(float)
    names = band_names(step, values.shape[-1])
    bands = {WHOLE: values}
    rest = filled
    for name in names[1:-1]:
        sigma = EDGES[name] / step * np.sqrt(2 * np.log(2)) / (2 * np.pi)
        share = gaussian_filter1d(weight, sigma, axis=-1, mode="constant")
        # the seen step itself is in its own average, so that ``share`` is far from zero wherever it is used
        part = gaussian_filter1d(rest, sigma, axis=-1, mode="constant") / np.where(seen, share, 1.0)
        part = np.where(seen, part, 0.0)
        bands[name] = np.where(seen, part, np.nan)
        rest = rest - part
    if len(names) > 1:
        bands[names[-1]] = np.where(seen, rest, np.nan)
    return bands
