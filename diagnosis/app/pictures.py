"""Pictures of the page: curves that zoom together, parameters in their ranges, and a column's readings in small."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
import panel as pn

from diagnosis.app.project import Column
from diagnosis.calibrating.schema import Calibration
from diagnosis.curves import BLUE, COLOURS, GREY, LABELS, ORANGE, RED
from diagnosis.panels import Curve, Panel, Strips, figure, models, picture
from shared.system import System


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
    height: int = 170,
    fitted_until: np.datetime64 | None = None,
) -> Any:
    """Pictures one below the other that zoom together.

    Parameters
    ----------
    panels
        Of each: what it is, its unit, times (steps,), and curves (steps,) by name as in
        :data:`diagnosis.curves.LABELS`.
    height
        Of a picture without its axis [px].
    fitted_until
        The end of what a fit has seen, on a grey ground.
    """
    made = []
    for words, unit, time, values in panels:
        curves = [
            Curve(label, COLOURS[name] if len(values) > 1 else BLUE, values[name])
            for name, label in LABELS.items()
            if name in values
        ]
        if {"low", "high"} <= values.keys():
            curves.insert(0, Curve("90 % band", ORANGE, np.stack([values["low"], values["high"]])))
        fitted = [] if fitted_until is None else [Strips("fitted", "#eeeff0", time[:1], np.array([fitted_until]))]
        made.append(Panel(words, unit, time, curves, fitted))
    return pn.pane.Bokeh(picture(made, height=height), sizing_mode="stretch_width", margin=0)
