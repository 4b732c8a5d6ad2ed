"""Pictures as text: matplotlib figures as PNG within a page."""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text

from shared.variables import ZERO_CELSIUS

BLUE, ORANGE, GREY, RED = "#1f5fa8", "#d9730d", "#8a8f98", "#b3261e"


def figure(rows: int = 1, *, height: float = 2.0, width: float = 10.0, sharex: bool = True) -> tuple[Figure, list[Any]]:
    """A figure of panels one above the other, without any window."""
    made = Figure(figsize=(width, height * rows + 0.4), layout="constrained")
    panels = made.subplots(rows, 1, sharex=sharex, squeeze=False)[:, 0]
    for panel in panels:
        panel.grid(alpha=0.25)
        panel.spines[["top", "right"]].set_visible(False)
    return made, list(panels)


def as_png(made: Figure, dpi: int = 110) -> bytes:
    """A figure as PNG, all text in it as it stands.

    Between two dollars matplotlib reads a formula, and ends in a traceback where it is none: loggers and users name
    columns, outputs and files as they like. Its own formulas are the labels of logarithmic axes.
    """
    for text in made.findobj(Text):
        text.set_parse_math(False)
    for axes in made.axes:
        for axis, scale in ((axes.xaxis, axes.get_xscale()), (axes.yaxis, axes.get_yscale())):
            for label in axis.get_ticklabels(which="both") if scale == "log" else ():
                label.set_parse_math(True)
    buffer = io.BytesIO()
    made.savefig(buffer, format="png", dpi=dpi)
    return buffer.getvalue()


def embedded(made: Figure) -> str:
    """A figure as the source of an HTML image."""
    return "data:image/png;base64," + base64.b64encode(as_png(made)).decode()


def readable(values: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """Values in the unit that people read: degrees Celsius for kelvin."""
    return (values - ZERO_CELSIUS, "°C") if unit == "K" else (values, unit)
