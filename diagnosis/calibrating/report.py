"""The page of a calibration: recording, fit and residuals, parameters before and after, what is identifiable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from datagen.driving.tables import Piecewise
from diagnosis.calibrating.calibrated import Calibrated
from diagnosis.calibrating.sentences import sentences
from diagnosis.calibrating.summary import CORRELATED
from diagnosis.fitting.unknowns import LIMIT, within_limit
from diagnosis.pages import long_named, page_environment
from diagnosis.physics import hints, warnings
from diagnosis.pictures import BLUE, GREY, ORANGE, RED, axis_label, calendar, embedded, figure, range_ends, readable
from diagnosis.recording import DAY, HOUR
from diagnosis.whole import whole

SPAN = 4.0
"""An output is drawn over so many standard deviations of its sensor's noise at least: less is nothing to be seen."""
_MANY = 12
"""Weather inputs and the like that a picture shows at most."""


def write_calibration(done: Calibrated, folder: Path) -> None:
    """Write ``calibration.json`` and ``calibration.html`` into a folder, both or none."""
    page = render(done)
    with whole(folder) as draft:
        text = done.report.model_dump_json(indent=1)
        (draft / "calibration.json").write_text(text + "\n", encoding="utf-8")
        (draft / "calibration.html").write_text(page, encoding="utf-8")


def render(done: Calibrated) -> str:
    """The page as HTML, pictures and all."""
    environment = page_environment()
    relative = {one.name: one.relative for one in done.problem.constants}
    inputs, rest = _inputs(done)
    return environment.get_template("calibration.html.j2").render(
        report=done.report,
        begin=done.problem.recording.began,
        days=done.report.steps * done.report.step / DAY,
        correlated_above=CORRELATED,
        outputs={one.name: one.long_name for one in done.problem.system.outputs},
        limit=f"{LIMIT:g}",
        within=lambda name, value: within_limit(value, relative.get(name)),
        warnings=warnings(done.report.physics),
        summary=sentences(done.report) + hints(done.report.physics),
        fit_picture=_fit(done),
        parameter_picture=_parameters(done),
        correlation_picture=_correlation(done),
        residual_picture=_residuals(done),
        input_picture=inputs,
        not_drawn=rest,
    )


def _days(done: Calibrated) -> np.ndarray:
    return np.asarray((done.problem.time - done.problem.drive.start) / DAY)


def _fit(done: Calibrated) -> str:
    problem, names = done.problem, list(done.report.outputs)
    made, panels = figure(len(names), height=2.1)
    for panel, name in zip(panels, names, strict=True):
        k = problem.system.output_names.index(name)
        output = problem.system.outputs[k]
        measured, unit = readable(problem.measured[k], output.unit)
        simulated, _ = readable(done.fit.around.outputs[k], output.unit)
        panel.plot(_days(done), measured, ".", ms=2.5, color=BLUE, label="measured")
        panel.plot(_days(done), simulated, lw=1.1, color=ORANGE, label="fitted")
        panel.set_ylabel(axis_label(output, unit), fontsize=8)
        if not done.report.outputs[name].used:
            panel.set_title("replayed: drives the model, not fitted", fontsize=8, loc="right")
        widened(panel, SPAN * float(problem.floor[k]))
    panels[0].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, fontsize=8)
    calendar(panels[-1], done.problem.recording.began)
    panels[-1].set_xlabel(f"days since {done.problem.recording.began}")
    return embedded(made)


def widened(panel: Axes, span: float) -> None:
    """Let the vertical axis of a panel span as much at least, about what it shows [unit of the panel]."""
    low, high = panel.get_ylim()
    if high - low < span:
        middle = 0.5 * (low + high)
        panel.set_ylim(middle - 0.5 * span, middle + 0.5 * span)


def _residuals(done: Calibrated) -> str:
    problem = done.problem
    names = [name for name, one in done.report.outputs.items() if one.used]
    made, panels = figure(len(names), height=1.7)
    for panel, name in zip(panels, names, strict=True):
        k = problem.system.output_names.index(name)
        left = problem.measured[k] - done.fit.around.outputs[k]
        band = 1.96 * problem.floor[k]
        panel.axhspan(-band, band, color=GREY, alpha=0.2, lw=0)
        panel.plot(_days(done), left, lw=0.8, color=RED)
        panel.set_ylabel(axis_label(problem.system.outputs[k], problem.system.outputs[k].unit), fontsize=8)
    calendar(panels[-1], done.problem.recording.began)
    panels[-1].set_xlabel(f"days since {done.problem.recording.began}")
    return embedded(made)


def _parameters(done: Calibrated) -> str:
    """Prior, posterior and zero-shot estimate, each parameter in its own range."""
    report, system = done.report, done.problem.system
    made, (panel,) = figure(1, height=0.42 * len(report.parameters) + 0.4)
    for row, (one, described) in enumerate(zip(report.parameters, system.parameters, strict=True)):
        place = described.to_unit
        panel.plot([0, 1], [row, row], lw=7, color=GREY, alpha=0.2, solid_capstyle="butt")
        colour = RED if one.at_bound else BLUE
        panel.plot([place(one.low), place(one.high)], [row, row], lw=4, color=colour, solid_capstyle="butt")
        panel.plot(place(one.value), row, "o", color=colour, ms=6)
        if one.zero_shot is not None:
            panel.plot(place(one.zero_shot), row, "D", color=ORANGE, ms=5)
        range_ends(panel, described, row)
    panel.set_yticks(
        range(len(report.parameters)), [long_named(one.name, one.description) for one in report.parameters], fontsize=8
    )
    panel.tick_params(axis="y", pad=34, length=0)
    panel.set_xlim(-0.02, 1.02)
    panel.set_xticks([])
    panel.set_ylim(len(report.parameters) - 0.5, -0.5)
    panel.grid(visible=False)
    panel.spines[["left", "bottom"]].set_visible(False)
    return embedded(made)


def _correlation(done: Calibrated) -> str:
    names = done.problem.names
    made, (panel,) = figure(1, height=0.36 * len(names) + 1.6, width=0.5 * len(names) + 3.2)
    values = np.array(done.report.correlation)
    panel.imshow(values, cmap="RdBu_r", vmin=-1, vmax=1)
    for i, j in np.ndindex(*values.shape):
        if abs(values[i, j]) >= 0.05 and i != j:
            colour = "white" if abs(values[i, j]) > 0.6 else "black"
            panel.text(j, i, f"{values[i, j]:.1f}", ha="center", va="center", fontsize=7, color=colour)
    panel.set_xticks(range(len(names)), names, rotation=60, ha="right", fontsize=8)
    panel.set_yticks(range(len(names)), names, fontsize=8)
    panel.grid(visible=False)
    return embedded(made)


def _inputs(done: Calibrated) -> tuple[str, list[str]]:
    """What drove the model: inputs that move, and the persons that were found where nobody counted them.

    Returns the picture, and the names of inputs that move and are not drawn.
    """
    problem = done.problem
    system, nuisance = problem.system, problem.nuisance
    found = {}
    for place, one in enumerate(system.inputs):
        if one.source == "occupancy" and problem.occupancy == "unknown":
            inside = (nuisance.column == place) & nuisance.recorded
            found[place] = (nuisance.begin[inside], done.fit.around.heights[inside])
    time = problem.time - 0.5 * problem.recording.step
    moving = [
        (one, values)
        for place, one in enumerate(system.inputs)
        if place not in found and np.ptp(values := problem.drive.signals[one.name].at(time)) > 0
    ]
    moving, rest = moving[:_MANY], moving[_MANY:]
    made, panels = figure(max(len(moving) + len(found), 1), height=1.3)
    for panel, (one, values) in zip(panels, moving, strict=False):
        shown, unit = readable(values, one.unit)
        panel.plot(_days(done), shown, lw=0.9, color=GREY)
        panel.set_ylabel(f"{one.name}\n[{unit}]", fontsize=8)
    levels = done.problem.values(done.fit.z)[problem.size - len(nuisance.levels) :]
    for panel, (place, (begin, heights)) in zip(panels[len(moving) :], found.items(), strict=False):
        level = next((x for one, x in zip(nuisance.levels, levels, strict=True) if one.column == place), 1.0)
        grid = np.arange(problem.drive.start, problem.drive.stop, 0.5 * HOUR)
        persons = np.zeros(len(grid))
        persons[np.searchsorted(grid, begin - 1.0)] = level * heights
        signal = Piecewise(grid, persons, "previous")
        panel.step((grid - grid[0]) / DAY, signal.at(grid), where="post", lw=0.9, color=ORANGE)
        panel.set_ylabel(f"{system.inputs[place].name}\ninferred", fontsize=8)
    calendar(panels[-1], done.problem.recording.began)
    panels[-1].set_xlabel(f"days since {done.problem.recording.began}")
    return embedded(made), [one.name for one, _ in rest]
