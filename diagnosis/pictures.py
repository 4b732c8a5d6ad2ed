"""Pictures as text: matplotlib figures as PNG within a page."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from matplotlib.figure import Figure

BLUE, ORANGE, GREY, RED = "#1f5fa8", "#d9730d", "#8a8f98", "#b3261e"


def figure(rows: int = 1, *, height: float = 2.0, width: float = 10.0, sharex: bool = True) -> tuple[Figure, list[Any]]:
    """A figure of panels one above the other, without any window."""
    made = Figure(figsize=(width, height * rows + 0.4), layout="constrained")
    panels = made.subplots(rows, 1, sharex=sharex, squeeze=False)[:, 0]
    for panel in panels:
        panel.grid(alpha=0.25)
        panel.spines[["top", "right"]].set_visible(False)
    return made, list(panels)


def embedded(made: Figure) -> str:
    """A figure as the source of an HTML image."""
    buffer = io.BytesIO()
    made.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def readable(values: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """Values in the unit that people read: degrees Celsius for kelvin."""
    return (values - 273.15, "°C") if unit == "K" else (values, unit)
