"""``report.json`` and ``report.html``: written together, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagnosis.curves import (
    BLUE,
    GREY,
    ORANGE,
    RED,
    at_day,
    axis_label,
    calendar,
    embedded,
    figure,
    range_ends,
    readable,
)
from diagnosis.fitting.runs import LIMIT, within_limit
from diagnosis.gap.concluded import Diagnosis
from diagnosis.gap.limits import added
from diagnosis.gap.reporting import sensors_among
from diagnosis.gap.schema import HOW_FAR, Place
from diagnosis.gap.sentences import headline
from diagnosis.gap.shrinkage import left_by
from diagnosis.gap.twins import SHOWN as SHOWN_TWINS
from diagnosis.pages import long_named, page_environment, whole
from diagnosis.physics import hints, warnings
from diagnosis.recording import DAY
from diagnosis.where.pictures import draw_cells, draw_correlations, draw_episodes, draw_sources
from diagnosis.where.sources import Verdict

_HATCH = "#b8a468"
LINES = 5
"""Limits and places that are told at once; more lie behind a click."""


def draw_outputs(done: Diagnosis) -> Figure:
    """Residuals of the base model and with the chosen effects; grey is what noise allows.

    With effects both are of the fits that do without the hatched part.
    """
    first = done.search.stages[0]
    base, found = first.twins.residual, None
    if done.apart is not None:
        colours = done.search.last.colours
        base, found = (left_by(one, colours, done.whole.observed) for one in (done.apart.before, done.apart.after))
    problem = first.lin.problem
    channels = first.grams.channels
    made, panels = figure(len(channels), height=1.7)
    days = (problem.time - problem.recording.start) / DAY
    for panel, k in zip(panels, channels, strict=True):
        output = problem.system.outputs[k]
        size = float(np.hypot(*first.colours.best[k][:2]))
        panel.axhspan(-2 * size, 2 * size, color=GREY, alpha=0.2, lw=0, label="two standard deviations of noise")
        panel.plot(days, base[k], color=ORANGE, lw=0.9, label="base model")
        if found is not None:
            panel.plot(days, found[k], color=BLUE, lw=0.9, label=added(done.report.verdict))
            _hatch(panel, days - problem.recording.step / DAY, days, done.scored)
        panel.set_ylabel(axis_label(output, readable(np.zeros(1), output.unit)[1].replace("°C", "K")), fontsize=8)
    panels[0].legend(loc="lower right", bbox_to_anchor=(1, 1), fontsize=8, ncols=4, frameon=False)
    calendar(panels[-1], problem.recording.began)
    panels[-1].set_xlabel("days of the recording, and the date on which they begin")
    return made


def _hatch(panel: Axes, begins: np.ndarray, ends: np.ndarray, scored: np.ndarray) -> None:
    """Hatch runs of scored steps from the begin of the first to the end of the last, all (steps,) [d]."""
    turns = np.flatnonzero(np.diff(scored.astype(int), prepend=0, append=0))
    for first, after in zip(turns[::2], turns[1::2], strict=True):
        panel.axvspan(
            begins[first], ends[after - 1], facecolor="none", edgecolor=_HATCH, hatch="//", lw=0, zorder=0,
            label="days kept from the fit" if first == turns[0] else None,
        )  # fmt: skip


def draw_parameters(done: Diagnosis) -> Figure:
    """Parameters before and after, in their ranges, each in the scale of its prior."""
    system = done.base.problem.system
    rows = done.report.parameters
    made = Figure(figsize=(10, 0.36 * len(rows) + 0.5), layout="constrained")
    axes = made.subplots()
    for i, (one, parameter) in enumerate(zip(rows, system.parameters, strict=True)):
        at = parameter.to_unit
        y = len(rows) - 1 - i
        axes.plot([0, 1], [y, y], color=GREY, lw=6, alpha=0.25, solid_capstyle="butt")
        axes.plot([at(one.before_low), at(one.before_high)], [y + 0.14] * 2, color=ORANGE, lw=2)
        axes.plot(at(one.before), y + 0.14, "o", color=RED if one.at_bound else ORANGE, ms=5)
        if one.after is not None and one.after_low is not None and one.after_high is not None:
            axes.plot([at(one.after_low), at(one.after_high)], [y - 0.14] * 2, color=BLUE, lw=2)
            axes.plot(at(one.after), y - 0.14, "o", color=RED if one.at_bound_after else BLUE, ms=5)
        range_ends(axes, parameter, y)
    axes.set_yticks(
        range(len(rows)), [long_named(one.name, one.description) for one in system.parameters][::-1], fontsize=8
    )
    axes.tick_params(axis="y", pad=34, length=0)
    axes.set_xlim(-0.02, 1.02)
    axes.set_xticks([])
    axes.spines[["top", "right", "left", "bottom"]].set_visible(False)
    return made


def write_report(done: Diagnosis, folder: Path) -> None:
    """Write ``report.json`` and ``report.html`` into a folder, both or none."""
    page = render(done)
    with whole(folder) as draft:
        (draft / "report.json").write_text(done.report.model_dump_json(indent=1) + "\n", encoding="utf-8")
        (draft / "report.html").write_text(page, encoding="utf-8")


def render(done: Diagnosis) -> str:
    """The page as HTML, pictures and all."""
    environment = page_environment(decimals=0)
    zero, system = done.whole.recording.zero, done.whole.system
    begin = zero + np.timedelta64(round(done.report.start), "s")
    environment.filters["dated"] = lambda one: dated(one, zero)
    relative = {one.name: one.relative for one in done.base.problem.constants}
    return environment.get_template("gap.html.j2").render(
        report=done.report,
        warnings=warnings(done.report.physics),
        hints=hints(done.report.physics),
        headline=headline(done.report),
        how_far=HOW_FAR,
        begin=str(begin).replace("T", " "),
        units={one.name: one.unit for one in done.report.effects},
        apart=done.apart is not None,
        added=added(done.report.verdict),
        days=done.report.steps * done.report.step / DAY,
        shown=SHOWN_TWINS,
        outputs={one.name: one.long_name for one in system.outputs},
        parameters={one.name: one.description for one in system.parameters}
        | {one.name: one.description for one in system.uncertain},
        lines=LINES,
        channel_units={one.name: one.unit for one in system.outputs},
        limit=f"{LIMIT:g}",
        constants=relative,
        within=lambda name, value: within_limit(value, relative.get(name)),
        pictures=_pictures(done),
    )


def answered_by(done: Diagnosis) -> set[Verdict]:
    """What the effects that the answer names are: errors of a sensor, of a balance, or both; "none" without a gap."""
    if done.report.verdict == "no_gap":
        return {"none"}
    sensors = sensors_among(done.search.stages[0])
    return {"sensor" if one.name in sensors else "balance" for one in done.report.effects if one.named}


def dated(one: Place, zero: np.datetime64) -> str:
    """The dates of a finding that has a time, in brackets; nothing for others."""
    stretch = [float(one.cell[key]) for key in ("first_s", "last_s") if key in one.cell]
    return f" ({' to '.join(at_day(zero, second, minutes=True) for second in stretch)})" if stretch else ""


def _pictures(done: Diagnosis) -> dict[str, str]:
    """All pictures by name, those that there is something to show in."""
    where, zero = done.where.among_all(), done.whole.recording.zero
    made: dict[str, Figure] = {
        "outputs": draw_outputs(done),
        "cells": draw_cells(where.residuals, where.cells),
        "episodes": draw_episodes(where.residuals, where.episodes, zero=zero),
        "parameters": draw_parameters(done),
    }
    if where.correlations is not None:
        made["correlations"] = draw_correlations(where.residuals, where.correlations)
    if where.sources is not None:
        explained = None
        if done.where_left is not None:
            gone = where.residuals.observed - done.where_left.residuals.observed
            explained = where.sources.courses(gone)
        made["sources"] = draw_sources(
            where.residuals, where.sources, answered=answered_by(done), explained=explained, zero=zero
        )
    return {name: embedded(one) for name, one in made.items()}
