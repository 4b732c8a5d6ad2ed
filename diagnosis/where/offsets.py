"""Offsets of places that overlap: all of one channel fitted together, so that none is charged for another."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from diagnosis.where.bands import split


@dataclass
class Offsets:
    """What the places that were named take from one channel's residual.

    An offset of everything that is named first is the mean of what holds and what does not; once the part that it does
    not hold for is named as well, it is another one. So all are fitted anew with each place that is added.

    Parameters
    ----------
    series
        The channel's residual [unit], shape (steps,); NaN where nothing was measured.
    step
        [s]
    scatter
        Variance of each band of the twins, from :func:`band_scatter`.
    """

    series: np.ndarray
    step: float
    scatter: list[float]
    places: list[np.ndarray] = field(default_factory=list)
    sizes: np.ndarray = field(default_factory=lambda: np.empty(0))

    def add(self, inside: np.ndarray) -> float:
        """Name a place (steps,), fit all anew, and return its offset [unit].

        Each band is weighted by its scatter: one band alone would not do, a wave looks in it like an offset that is far
        larger than the wave.
        """
        self.places.append(inside)
        self._fit()
        return float(self.sizes[-1])

    def change(self, inside: np.ndarray, by: np.ndarray) -> None:
        """Add something else to the residual within a place, and fit all anew."""
        self.series = self.series.copy()
        self.series[inside] += by
        self._fit()

    @property
    def left(self) -> np.ndarray:
        """The residual without all offsets [unit], shape (steps,)."""
        left = self.series.copy()
        for inside, size in zip(self.places, self.sizes, strict=True):
            left[inside] -= size
        return left

    def overlap(self, inside: np.ndarray) -> bool:
        """Whether a place shares a step with one that was named."""
        return any(bool((one & inside).any()) for one in self.places)

    def _fit(self) -> None:
        if not self.places:
            return
        seen = np.isfinite(self.series)
        shapes = _parts(np.where(seen, np.array(self.places, dtype=float), np.nan), self.step)
        normal, across = np.zeros((len(self.places),) * 2), np.zeros(len(self.places))
        for part, shape, variance in zip(_parts(self.series, self.step), shapes, self.scatter, strict=True):
            normal += shape[:, seen] @ shape[:, seen].T / variance
            across += shape[:, seen] @ part[seen] / variance
        # places that add up to another leave a choice: the least offsets
        self.sizes = np.linalg.lstsq(normal, across, rcond=1e-10)[0]


def band_scatter(values: np.ndarray, step: float, floor: float) -> list[float]:
    """Variance of each band of a channel's twins (rows, steps), the whole left out unless it is all there is."""
    return [max(float(np.nanvar(one)), floor) for one in _parts(values, step)]


def _parts(values: np.ndarray, step: float) -> list[np.ndarray]:
    parts = list(split(values, step).values())
    return parts[1:] or parts


