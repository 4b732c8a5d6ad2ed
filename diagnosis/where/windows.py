"""When a cell holds: hours of the day and day types, from single hours to the whole record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.where.series import HOUR, Residuals

DAY_TYPES = ("any", "weekday", "weekend")
BLOCK = 6
"""Length of the coarse blocks of hours [h]."""


@dataclass(frozen=True)
class Window:
    """Hours of the day from ``start`` up to ``stop`` [h] on days of a type."""

    start: int
    stop: int
    day_type: str

    @property
    def hours(self) -> str:
        """As a reader sees it."""
        return "any" if (self.start, self.stop) == (0, 24) else f"{self.start:02d}:00-{self.stop:02d}:00"


def hour_width(step: float) -> int:
    """Width of the finest hour cells [h]: an hour, or the step when that is longer."""
    return next(width for width in (1, 2, 3, 4, 6, 8, 12, 24) if width * HOUR >= step or width == 24)


def all_windows(residuals: Residuals) -> tuple[list[Window], np.ndarray]:
    """Windows, simplest first, and when they hold: shape (windows, steps).

    The order decides which of two windows that hold at the same steps is named.
    """
    width = hour_width(residuals.step)
    spans = [(0, 24)]
    if BLOCK % width == 0:  # of steps of four hours, a block of six would hold one or two
        spans += [(start, start + BLOCK) for start in range(0, 24, BLOCK)]
    if width < BLOCK:
        spans += [(start, start + width) for start in range(0, 24, width)]
    days = {"any": np.ones(len(residuals.time), bool), "weekday": ~residuals.weekend, "weekend": residuals.weekend}
    windows = [Window(start, stop, day_type) for start, stop in spans for day_type in DAY_TYPES]
    hour = residuals.hour
    holds = np.stack([(hour >= w.start) & (hour < w.stop) & days[w.day_type] for w in windows])
    return windows, holds
