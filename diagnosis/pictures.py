"""Pictures as text: matplotlib figures as PNG within a page."""

from __future__ import annotations

import base64
import io
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, MaxNLocator
from PIL import Image

from diagnosis.pages import long_named
from shared.units import ABSOLUTE
from shared.variables import ZERO_CELSIUS, Output, Parameter, spaced
from trainer.figures import Picture

BLUE, ORANGE, GREY, RED = "#1f5fa8", "#d9730d", "#8a8f98", "#b3261e"


PALETTE = 256
"""In a picture's palette, the most that a byte for each pixel tells apart: a page is a third of its size so."""


def figure(rows: int = 1, *, height: float = 2.0, width: float = 10.0, sharex: bool = True) -> tuple[Figure, list[Any]]:
    """A figure of panels one above the other, without any window."""
    made = Picture(figsize=(width, height * rows + 0.4), layout="constrained")
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
    drawn, packed = io.BytesIO(), io.BytesIO()
    made.savefig(drawn, format="png", dpi=dpi)
    drawn.seek(0)
    Image.open(drawn).convert("RGB").quantize(PALETTE, dither=Image.Dither.NONE).save(packed, "PNG", optimize=True)
    return packed.getvalue()


def calendar(panel: Axes, begin: np.datetime64 | str) -> None:
    """Dates below the days of a horizontal axis, which counts them from the begin of a recording."""
    zero = np.datetime64(begin)

    def label(day: float, _: int | None = None) -> str:
        return f"{day:g}\n{at_day(zero, day * 86400.0)}"

    panel.xaxis.set_major_locator(MaxNLocator(nbins=8, steps=[1, 2, 2.5, 5, 10]))
    panel.xaxis.set_major_formatter(FuncFormatter(label))


def at_day(zero: np.datetime64, second: float, *, minutes: bool = False) -> str:
    """Day and month of a time [s since ``zero``], with hour and minute if asked for or where it is not midnight."""
    at = (zero + np.timedelta64(round(second / 60), "m")).astype("datetime64[m]").item()
    text = f"{at.day} {at:%b}"
    return f"{text} {at:%H:%M}" if minutes or (at.hour, at.minute) != (0, 0) else text


def axis_label(output: Output, unit: str) -> str:
    """What an output is, the name that the model has for it, and the unit that it is drawn in, in short lines."""
    return f"{fill(long_named(output.name, output.long_name), 22)}\n[{unit}]"


def range_ends(panel: Axes, parameter: Parameter, row: float) -> None:
    """Write the ends of a parameter's range, which spans 0 to 1, beside its row, and "log" where its scale is."""
    log = ", log" if parameter.scale == "log" else ""
    unit = spaced(parameter.unit)
    for at, side, text in ((-0.01, "right", f"{parameter.min:g}"), (1.01, "left", f"{parameter.max:g}{unit}{log}")):
        panel.text(at, row, text, ha=side, va="center", fontsize=7)


def embedded(made: Figure) -> str:
    """A figure as the source of an HTML image."""
    return "data:image/png;base64," + base64.b64encode(as_png(made)).decode()


def readable(values: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """Values in the unit that people read: degrees Celsius for kelvin, unless these are differences of temperature."""
    seen = values[np.isfinite(values)]
    if unit != "K" or (seen.size and float(np.median(seen)) < ABSOLUTE):
        return values, unit
    return values - ZERO_CELSIUS, "°C"
