"""Colours and helpers that the pictures share."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

MEASURED = "#cc3311"
TWINS = "#bbbbbb"
QUIET = "#4477aa"
OUTLINE = "black"
DIVERGING = "RdBu_r"


def outline(axes: Axes, mask: np.ndarray) -> None:
    """A frame around every connected group of an image's cells; ``mask`` (rows, columns)."""
    padded = np.pad(mask, 1)
    lines = []
    for i, j in np.argwhere(mask):
        if not padded[i, j + 1]:
            lines.append([(j - 0.5, i - 0.5), (j + 0.5, i - 0.5)])
        if not padded[i + 2, j + 1]:
            lines.append([(j - 0.5, i + 0.5), (j + 0.5, i + 0.5)])
        if not padded[i + 1, j]:
            lines.append([(j - 0.5, i - 0.5), (j - 0.5, i + 0.5)])
        if not padded[i + 1, j + 2]:
            lines.append([(j + 0.5, i - 0.5), (j + 0.5, i + 0.5)])
    axes.add_collection(LineCollection(lines, colors=OUTLINE, linewidths=1.8, capstyle="projecting", clip_on=False))


def few_digits(unit: str, peak: float) -> tuple[float, str]:
    """Factor and unit in which a peak is a number of a few digits."""
    if unit == "kg/s" and 0 < peak < 1e-3:
        return 1e6, "mg/s"
    if unit == "W" and peak >= 2e4:
        return 1e-3, "kW"
    return 1.0, unit
