"""Curves of an answer: what was measured and what models say, output by output, as a Dataset and as a picture."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, MaxNLocator
from PIL import Image

from shared.units import ABSOLUTE
from shared.variables import ZERO_CELSIUS, Output, Parameter, spaced
from trainer.figures import Picture

BLUE, ORANGE, GREY, RED = "#1f5fa8", "#d9730d", "#8a8f98", "#b3261e"


PALETTE = 256
"""In a picture's palette, the most that a byte for each pixel tells apart: a page is a third of its size so."""


def figure(rows: int = 1, *, height: float = 2.0, width: float = 10.0) -> tuple[Figure, list[Any]]:
    """A figure of panels one above the other, without any window."""
    made = Picture(figsize=(width, height * rows + 0.4), layout="constrained")
    panels = made.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
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


LABELS = {"measured": "measured", "before": "model", "after": "model with the named effects", "model": "model"}
"""What the curves are called, in the order in which they are drawn; ``low`` and ``high`` are the ends of a band."""
COLOURS = {"measured": GREY, "before": ORANGE, "after": BLUE, "model": ORANGE}


def dates(zero: np.datetime64, time: np.ndarray) -> np.ndarray:
    """Dates of times [s since ``zero``], to the millisecond."""
    stamps = zero.astype("datetime64[ms]") + np.round(np.asarray(time) * 1000).astype("timedelta64[ms]")
    return stamps.astype("datetime64[ns]")


def curves(time: np.ndarray, zero: np.datetime64, outputs: Sequence[Output], **series: np.ndarray | None) -> xr.Dataset:
    """Curves as a Dataset.

    Parameters
    ----------
    time
        Ends of the steps, shape (steps,) [s since ``zero``].
    outputs
        What the rows are.
    series
        By name (see :data:`LABELS`), each (outputs, steps) [unit of each]; None for one that there is not.

    Returns
    -------
    Dataset
        Variables over (output, time), with ``unit`` and ``long_name`` of each output as coordinates.
    """
    return xr.Dataset(
        {name: (("output", "time"), values) for name, values in series.items() if values is not None},
        coords={
            "output": [one.name for one in outputs],
            "time": dates(zero, time),
            "unit": ("output", [one.unit for one in outputs]),
            "long_name": ("output", [one.long_name or one.name for one in outputs]),
        },
    )


def shown(drawn: xr.Dataset) -> list[tuple[str, str, dict[str, np.ndarray]]]:
    """For each output that was measured or modelled: its name in words, the unit people read, and its curves in it."""
    found = []
    for name in drawn["output"].values:
        one = drawn.sel(output=name)
        values = {str(key): np.asarray(one[key].values, dtype=float) for key in drawn.data_vars}
        if not any(np.isfinite(value).any() for value in values.values()):
            continue
        unit = str(one["unit"].values)
        values = {key: readable(value, unit)[0] for key, value in values.items()}
        _, read_in = readable(np.asarray(one[next(iter(drawn.data_vars))].values, dtype=float), unit)
        found.append((str(one["long_name"].values), read_in, values))
    return found


def plot(drawn: xr.Dataset) -> Figure:
    """A panel for each output: measured, models, and the band where there is one."""
    rows = shown(drawn)
    made, panels = figure(max(len(rows), 1), height=2.0)
    time = drawn["time"].values
    for panel, (words, unit, values) in zip(panels, rows, strict=False):
        if {"low", "high"} <= values.keys():
            panel.fill_between(time, values["low"], values["high"], color=ORANGE, alpha=0.2, lw=0, label="90 % band")
        for key, label in LABELS.items():
            if key in values:
                style = {"ls": "", "marker": ".", "ms": 2.5} if key == "measured" else {"lw": 1.1}
                panel.plot(time, values[key], color=COLOURS[key], label=label, **style)
        panel.set_ylabel(f"{words}\n[{unit}]", fontsize=8)
    if rows:
        panels[0].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, fontsize=8, frameon=False)
    return made
