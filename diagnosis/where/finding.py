"""One place where recording and model differ, as a sentence and as a row of the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from diagnosis.where.series import HOUR, MEANING, WHOLE, Residuals
from shared.numbers import number
from shared.variables import spaced

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


Kind = Literal["cell", "correlation", "episode", "source", "sensor"]


@dataclass(frozen=True)
class Finding:
    """A significant difference.

    ``cell`` says where it lies, in words by name; ``size`` is the difference in ``unit``: measured less simulated, to
    the rest of the recording where ``direction`` says "than elsewhere" or "than in the rest of the recording", and for
    scatter that of the standard deviations. Means are of all periods, in whatever band they stand out. ``t`` is its
    studentised value and ``p_value`` the family-wise one.
    """

    kind: Kind
    channel: str
    label: str
    cell: dict[str, str]
    p_value: float
    direction: str
    size: float
    unit: str
    t: float

    @property
    def text(self) -> str:
        """As a sentence."""
        if self.kind == "correlation":
            said = f"{self.direction} {self.cell['lag']} {self.cell['input']} is high"
            return f"{self.label}: {said} (r = {self.size:+.2f}, p = {self.p_value:.2g})"
        return f"{self.label}: {self.direction}{self._amount()}{self._place()} (p = {self.p_value:.2g})"

    def _amount(self) -> str:
        if self.kind == "sensor":
            return f" (log likelihood ratio {number(self.size, 3, signed=True)})"
        return f" by {number(abs(self.size), 3)}{spaced(self.unit)}"

    def _place(self) -> str:
        words = []
        if self.kind == "sensor":
            return ""
        if self.kind in ("episode", "source"):
            return f", {self.cell['period']}"
        if self.cell["hours"] != "any":
            words.append(f"at {self.cell['hours']}")
        if self.cell["day_type"] != "any":
            words.append(f"on {self.cell['day_type']}s" if self.cell["day_type"] == "weekday" else "at weekends")
        if self.cell["regime"] != "any":
            words.append(f"while {self.cell['regime']}")
        if self.cell["band"] != WHOLE and self.cell["statistic"] != "mean":  # the amount of a mean is no band's
            words.append(f"over {MEANING[self.cell['band']]}")
        return ", " + ", ".join(words) if words else ", throughout"
