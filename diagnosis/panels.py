"""Curves against time as pictures that zoom: panels one above the other, drawn in the browser by Bokeh."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from textwrap import fill
from typing import Any, Literal

import numpy as np
from bokeh import models as bokeh_models
from bokeh import plotting
from bokeh.embed import components
from bokeh.layouts import gridplot
from bokeh.resources import Resources

figure: Any = plotting.figure
models: Any = bokeh_models
"""Of any type, both: bokeh's properties are set by names that a type checker does not know."""
_FONT = "system-ui, sans-serif"
_WRAPPED = ".bk-grid { display: flex; flex-wrap: wrap; gap: 0 14px; max-width: min(960px, 100vw - 115px); }"
"""A key breaks its line rather than leave a narrow window."""
_FINGER = "if (matchMedia('(pointer: coarse)').matches) { drag.active = false; wheel.active = true }"
"""Where fingers point, one moves the page and two zoom."""


@dataclass(frozen=True)
class Curve:
    """A curve, or the band between two.

    ``values`` (points,), or (2, points) of a band [unit of the panel]: of one point where it is the same at all times.
    Marks are dots on another curve: the pointer does not read them.
    """

    label: str
    colour: str
    values: np.ndarray
    style: Literal["solid", "dashed", "dots", "marks"] = "solid"


@dataclass(frozen=True)
class Strips:
    """Stretches of time on another ground: ``begins`` and ``ends`` (stretches,) are dates."""

    label: str
    colour: str
    begins: np.ndarray
    ends: np.ndarray
    hatched: bool = False


@dataclass(frozen=True)
class Panel:
    """Curves with a common unit; all panels of a picture have the same labels.

    ``time`` (points,) are dates. With ``stepwise`` a value holds around its time. The vertical axis spans at least
    ``span`` [unit].
    """

    title: str
    unit: str
    time: np.ndarray
    curves: Sequence[Curve]
    strips: Sequence[Strips] = ()
    stepwise: bool = False
    span: float | None = None


def library() -> str:
    """What draws pictures in a browser, for the head of a page, which loads nothing from elsewhere then.

    For formulas, icons and maps Bokeh would: these addresses are taken out.
    """
    code = str(Resources(mode="inline", components=["bokeh"]).render_js())
    return re.sub(r"""https://(?:cdn|maps)\.[^"'`]*""", "", code)


def embedded(panels: Sequence[Panel], *, height: int = 130) -> str:
    """A picture as HTML, for a page with :func:`library` in its head; nothing without panels.

    ``height`` of a panel without its axis [px].
    """
    if not panels:
        return ""
    script, place = components(picture(panels, height=height))
    return f'<div class="zooms">{place}<noscript>This picture needs JavaScript.</noscript></div>{script}'


def picture(panels: Sequence[Panel], *, height: int = 130) -> Any:
    """Panels that zoom and move together, with one key that hides a curve in all of them."""
    first, last = min(one.time[0] for one in panels), max(one.time[-1] for one in panels)
    days = models.Range1d(first, last, bounds=(first, last))
    made, same = [], dict[str, list[Any]]()
    for one in panels:
        drawn = figure(
            frame_height=height, x_range=days, x_axis_type="datetime", sizing_mode="stretch_width", tools=[],
            min_border_left=48, min_border_right=30, outline_line_color=None,
        )  # fmt: skip
        _draw(drawn, one, same)
        drawn.add_layout(models.Span(location=0, dimension="width", line_width=0.7, level="underlay"))
        # plain: of a formula between dollars, Bokeh would load from elsewhere what draws it
        drawn.title.update(text=models.PlainText(fill(f"{one.title} [{one.unit}]", 48)))
        drawn.title.update(text_font=_FONT, text_font_size="12px", text_font_style="normal")
        for axis in drawn.axis:
            axis.update(major_label_text_font=_FONT, minor_tick_line_color=None, axis_line_color="#5b6168")
        drawn.xaxis.major_label_policy = models.NoOverlap()
        drawn.xaxis.formatter = models.DatetimeTickFormatter(hours="%d %b %H:%M", days="%d %b", months="%b %Y")
        drawn.yaxis.ticker.desired_num_ticks, drawn.y_range.min_interval = 4, one.span
        made.append(drawn)
    for shown, *others in same.values():
        for other in others:
            shown.js_link("visible", other, "visible")
    if len(same) > 1:
        key = models.Legend(
            items=[models.LegendItem(label=label, renderers=ones[:1]) for label, ones in same.items()],
            click_policy="hide", orientation="horizontal", border_line_color=None, padding=0, margin=0,
            label_text_font=_FONT, label_text_font_size="12px", stylesheets=[_WRAPPED],
        )  # fmt: skip
        made[0].add_layout(key, "above")
    grid: Any = gridplot([[one] for one in made], sizing_mode="stretch_width", toolbar_options={"logo": None})
    tools = {type(one.tools[0]): one for one in grid.toolbar.tools}
    drag, wheel = tools[models.BoxZoomTool], tools[models.WheelZoomTool]
    grid.toolbar.active_drag = drag
    made[0].js_on_change("inner_width", models.CustomJS(args={"drag": drag, "wheel": wheel}, code=_FINGER))
    return grid


def _draw(drawn: Any, panel: Panel, same: dict[str, list[Any]]) -> None:
    """Draw a panel's curves and strips with its tools, and note them under their labels."""
    values = {one.label: np.asarray(one.values, dtype=np.float32) for one in panel.curves}
    columns, said = {"time": panel.time}, "<b>@time{%a %d %b %H:%M}</b>"
    for curve in panel.curves:
        name, of = curve.label, values[curve.label]
        if of.shape[-1] == 1:
            continue
        ends = {name: of} if of.ndim == 1 else {f"{name}, low": of[0], f"{name}, high": of[1]}
        columns |= ends
        if curve.style != "marks":
            said += f'<br><span style="color: {curve.colour}">&#9632;</span> {escape(name)}: '
            said += f"{' to '.join(f'@{{{end}}}{{%.4g}}' for end in ends)} {escape(panel.unit)}"
    source = models.ColumnDataSource(columns)
    for curve in panel.curves:
        name, of, ink = curve.label, values[curve.label], {"color": curve.colour}
        if of.ndim == 2 and of.shape[1] == 1:
            one = drawn.varea(panel.time[[0, -1]], *np.repeat(of, 2, axis=1), fill_alpha=0.25, **ink)
        elif of.ndim == 2:
            area, step = (drawn.varea_step, {"step_mode": "center"}) if panel.stepwise else (drawn.varea, {})
            one = area("time", f"{name}, low", f"{name}, high", source=source, fill_alpha=0.25, **ink, **step)
        elif curve.style in ("dots", "marks"):
            one = drawn.scatter("time", name, source=source, size=3, **ink)
        else:
            line, step = (drawn.step, {"mode": "center"}) if panel.stepwise else (drawn.line, {})
            one = line("time", name, source=source, line_dash=curve.style, line_width=1.3, **ink, **step)
        same.setdefault(name, []).append(one)
    for strips in panel.strips:
        hatch = {"fill_color": None, "hatch_pattern": "right_diagonal_line", "hatch_color": strips.colour}
        look = hatch if strips.hatched else {"fill_color": strips.colour}
        one = drawn.vstrip(x0=strips.begins, x1=strips.ends, line_color=None, level="underlay", **look)
        same.setdefault(strips.label, []).append(one)
    # what the pointer reads from: the curve with most values, drawn invisibly because the key may hide the curve itself
    whole = max((name for name, of in values.items() if of.ndim == 1), key=lambda name: np.isfinite(values[name]).sum())
    hover = models.HoverTool(
        mode="vline", point_policy="follow_mouse", visible=False,
        renderers=[drawn.line("time", whole, source=source, alpha=0.0)],
        tooltips=f'<div style="font: 12px {_FONT}; max-width: 42vw">{said}</div>',
        formatters={"@time": "datetime"} | {f"@{{{name}}}": "printf" for name in columns if name != "time"},
    )  # fmt: skip
    drag, move = models.BoxZoomTool(dimensions="width"), models.PanTool(dimensions="width")
    drawn.add_tools(drag, move, models.WheelZoomTool(dimensions="width"), models.ResetTool(), hover)
    drawn.toolbar.active_drag = drag
