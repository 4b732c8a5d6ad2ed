"""Pictures of the page: curves that zoom together, parameters in their ranges, and a column's readings in small."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape
from typing import Any

import numpy as np
import panel as pn
from bokeh import models as bokeh_models
from bokeh import plotting

from diagnosis.app.project import Column
from diagnosis.calibrating.schema import Calibration
from diagnosis.curves import BLUE, COLOURS, GREY, LABELS, ORANGE, RED
from shared.system import System

figure: Any = plotting.figure
models: Any = bokeh_models
"""Of any type, both: bokeh's properties are set by names that a type checker does not know."""
STAMPS = {"@time": "datetime"}


def spark(one: Column) -> str:
    """A column's readings as a small picture (SVG)."""
    values = np.asarray(one.points)
    if values.size < 2 or not np.isfinite(values).all():
        return ""
    low, span = float(values.min()), float(np.ptp(values)) or 1.0
    x = np.linspace(1, 219, len(values))
    y = 31 - 30 * (values - low) / span
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return (
        "<svg viewBox='0 0 220 32' width='220' height='32' preserveAspectRatio='none' role='img'"
        f" aria-label='{escape(one.name, quote=True)}'><polyline points='{points}' fill='none' stroke='{BLUE}'/></svg>"
    )


def legend(names: Collection[str]) -> str:
    """What the colours of curves are, as HTML."""
    known = {**{name: (COLOURS[name], label) for name, label in LABELS.items()}, "low": (ORANGE, "90 % band")}
    return " ".join(f"<span style='color:{known[one][0]}'>■</span> {known[one][1]}" for one in known if one in names)


def intervals(report: Calibration, system: System) -> Any:
    """Each parameter's value and 90 % interval within the range of its description, in the scale of that."""
    words = {one.name: one.description or one.name for one in report.parameters}
    made = figure(
        height=34 * len(words) + 40,
        sizing_mode="stretch_width",
        toolbar_location=None,
        y_range=list(dict.fromkeys(reversed(words.values()))),
        x_range=models.Range1d(-0.02, 1.02),
    )
    ranges = {one.name: one for one in system.parameters}
    for one in report.parameters:
        place, row = ranges[one.name].to_unit, words[one.name]
        colour = RED if one.at_bound else BLUE
        made.line([0, 1], [row, row], line_width=8, color=GREY, alpha=0.2)
        made.line([place(one.low), place(one.high)], [row, row], line_width=5, color=colour)
        made.scatter([place(one.value)], [row], size=9, color=colour)
        if one.zero_shot is not None:
            made.scatter([place(one.zero_shot)], [row], size=9, marker="diamond", color=ORANGE)
    made.xaxis.visible, made.xgrid.visible, made.ygrid.visible = False, False, False
    return pn.pane.Bokeh(made, sizing_mode="stretch_width", margin=0)


def figures(
    panels: Sequence[tuple[str, str, np.ndarray, dict[str, np.ndarray]]],
    *,
    height: int = 210,
    fitted_until: np.datetime64 | None = None,
    phone: bool = False,
) -> Any:
    """Pictures one below the other that zoom together; the first has the tools for all.

    Parameters
    ----------
    panels
        Of each: what it is, its unit, times (steps,), and curves (steps,) by name as in
        :data:`diagnosis.curves.LABELS`.
    height
        Of a picture [px].
    fitted_until
        The end of what a fit has seen, on a grey ground.
    phone
        Whether a finger that moves over a picture is to move the page rather than to zoom.
    """
    made: list[Any] = []
    for words, unit, time, values in panels:
        together = {"x_range": made[0].x_range} if made else {}
        one = figure(
            height=height,
            sizing_mode="stretch_width",
            x_axis_type="datetime",
            title=f"{words} [{unit}]",
            tools=[],
            toolbar_location=None if made else "above",
            **together,
        )
        zoom, pan, wheel = (
            models.BoxZoomTool(dimensions="width"),
            models.PanTool(dimensions="width"),
            models.WheelZoomTool(dimensions="width"),
        )
        one.add_tools(zoom, pan, wheel, models.ResetTool())
        one.toolbar.active_drag, one.toolbar.logo = None if phone else zoom, None
        if fitted_until is not None:
            one.varea([time[0], fitted_until], *_ends(values), color=GREY, alpha=0.15)
        if {"low", "high"} <= values.keys():
            source = models.ColumnDataSource({"time": time, "low": values["low"], "high": values["high"]})
            band = models.Band(
                base="time", lower="low", upper="high", source=source, fill_color=ORANGE, fill_alpha=0.25
            )
            one.add_layout(band)
        for key in [name for name in LABELS if name in values]:
            source = models.ColumnDataSource({"time": time, "value": values[key]})
            colour = COLOURS[key] if len(values) > 1 else BLUE
            one.line("time", "value", source=source, color=colour, line_width=1.3)
        one.xaxis.formatter = models.DatetimeTickFormatter(days="%d %b", hours="%d %b %H h", months="%b %Y")
        one.yaxis.ticker.desired_num_ticks, one.title.text_font_size = 4, "10pt"
        one.add_tools(models.HoverTool(mode="vline", tooltips="@time{%d %b %H:%M}: @value{0.00}", formatters=STAMPS))
        made.append(one)
    return pn.Column(
        *(pn.pane.Bokeh(one, sizing_mode="stretch_width", margin=(0, 2)) for one in made),
        sizing_mode="stretch_width",
        margin=0,
    )


def _ends(values: dict[str, np.ndarray]) -> tuple[list[float], list[float]]:
    """The lowest and the highest of all curves, twice each."""
    seen = [one[np.isfinite(one)] for one in values.values() if np.isfinite(one).any()]
    low, high = min(float(one.min()) for one in seen), max(float(one.max()) for one in seen)
    return [low, low], [high, high]
