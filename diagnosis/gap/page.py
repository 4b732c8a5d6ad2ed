"""``report.json`` and ``report.html``: written together, whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from diagnosis import panels
from diagnosis.curves import BLUE, GREY, ORANGE, RED, at_day, dates, embedded, range_ends
from diagnosis.fitting.runs import LIMIT, within_limit
from diagnosis.gap.concluded import Diagnosis
from diagnosis.gap.limits import added
from diagnosis.gap.reporting import sensors_among
from diagnosis.gap.schema import HOW_FAR, Place
from diagnosis.gap.sentences import headline
from diagnosis.gap.shrinkage import left_by
from diagnosis.gap.twins import SHOWN as SHOWN_TWINS
from diagnosis.pages import long_named, page_environment, write_answer
from diagnosis.panels import Curve, Panel, Strips
from diagnosis.physics import hints, warnings
from diagnosis.recording import DAY
from diagnosis.where.pictures import draw_cells, draw_correlations, draw_episodes, source_panels
from diagnosis.where.sources import Verdict

_HATCH = "#b8a468"
LINES = 5
"""Limits and places that are told at once; more lie behind a click."""


def output_panels(done: Diagnosis) -> list[Panel]:
    """Residuals of the base model and with the chosen effects; grey is what noise allows.

    With effects both are of the fits that do without the hatched part.
    """
    first = done.search.stages[0]
    residuals, kept = {"base model": (ORANGE, first.twins.residual)}, []
    problem = first.lin.problem
    zero, time = problem.recording.zero, problem.time
    if done.apart is not None:
        before, after = (
            left_by(one, done.search.last.colours, done.whole.observed) for one in (done.apart.before, done.apart.after)
        )
        residuals = {"base model": (ORANGE, before), added(done.report.verdict): (BLUE, after)}
        turns = np.diff(done.scored.astype(int), prepend=0, append=0)
        begins, ends = time[turns[:-1] > 0] - problem.recording.step, time[turns[1:] < 0]
        kept = [Strips("days kept from the fit", _HATCH, dates(zero, begins), dates(zero, ends), hatched=True)]
    made = []
    for k in first.grams.channels:
        output = problem.system.outputs[k]
        size = 2 * float(np.hypot(*first.colours.best[k][:2]))
        noise = Curve("two standard deviations of noise", GREY, np.array([[-size], [size]]))
        both = [Curve(name, colour, of[k]) for name, (colour, of) in residuals.items()]
        title, unit = long_named(output.name, output.long_name), output.unit.replace("°C", "K")
        made.append(Panel(title, unit, dates(zero, time), [noise, *both], kept))
    return made


def draw_parameters(done: Diagnosis) -> Figure:
    """Parameters before and after, in their ranges, each in the scale of its prior."""
    system = done.search.base.lin.problem.system
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
    write_answer(folder, "report", done.report, render(done))


def render(done: Diagnosis) -> str:
    """The page as HTML, pictures and all."""
    environment = page_environment(decimals=0)
    zero, system = done.whole.recording.zero, done.whole.system
    begin = zero + np.timedelta64(round(done.report.start), "s")
    environment.filters["dated"] = lambda one: dated(one, zero)
    relative = {one.name: one.relative for one in done.search.base.lin.problem.constants}
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
        missing=_missing(done),
        bokeh=panels.library(),
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
        "cells": draw_cells(where.residuals, where.cells),
        "episodes": draw_episodes(where.residuals, where.episodes, zero=zero),
        "parameters": draw_parameters(done),
    }
    if where.correlations is not None:
        made["correlations"] = draw_correlations(where.residuals, where.correlations)
    zooming = {"outputs": output_panels(done)}
    if where.sources is not None:
        explained = None
        if done.where_left is not None:
            gone = where.residuals.observed - done.where_left.residuals.observed
            explained = where.sources.courses(gone)
        zooming["sources"] = source_panels(where.residuals, where.sources, zero, explained=explained)
    drawn = {name: panels.embedded(one) for name, one in zooming.items()}
    return {name: embedded(one) for name, one in made.items()} | drawn


def _missing(done: Diagnosis) -> list[str]:
    """What is said of each source that the balances may lack."""
    where = done.where.among_all()
    if where.sources is None or done.report.unlike:
        return []
    return where.sources.said(dict(zip(where.residuals.names, where.residuals.labels, strict=True)), answered_by(done))
