"""The page of a calibration: recording, fit and residuals, parameters before and after, what is identifiable."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from datagen.tables import Piecewise
from diagnosis.calibrating.calibration import Calibrated
from diagnosis.calibrating.summary import CORRELATED
from diagnosis.pages import page_environment
from diagnosis.pictures import BLUE, GREY, ORANGE, RED, embedded, figure, readable
from diagnosis.recording import DAY, HOUR
from diagnosis.whole import whole

POOR = 0.5
"""A model that explains less than this share of an output's variance is not believed."""
OUTER = 1.28
"""Beyond this [prior standard deviations] a parameter lies in the outer tenths of its range: no prior left it."""
_MANY = 12
"""Weather inputs and the like that a picture shows at most."""


def write_calibration(done: Calibrated, folder: Path) -> None:
    """Write ``calibration.json`` and ``calibration.html`` into a folder, both or none."""
    page = render(done)
    with whole(folder) as draft:
        text = json.dumps(done.report.model_dump(mode="json"), indent=1)
        (draft / "calibration.json").write_text(text + "\n", encoding="utf-8")
        (draft / "calibration.html").write_text(page, encoding="utf-8")


def render(done: Calibrated) -> str:
    """The page as HTML, pictures and all."""
    environment = page_environment()
    return environment.get_template("calibration.html.j2").render(
        report=done.report,
        begin=began(done),
        days=done.report.steps * done.report.step / DAY,
        correlated_above=CORRELATED,
        summary=summary(done),
        fit_picture=_fit(done),
        parameter_picture=_parameters(done),
        correlation_picture=_correlation(done),
        residual_picture=_residuals(done),
        input_picture=_inputs(done),
    )


def began(done: Calibrated) -> str:
    """When the recording began, to the minute, by its own clock."""
    begin = done.problem.recording.zero + np.timedelta64(round(done.report.start), "s")
    return str(begin.astype("datetime64[m]")).replace("T", " ")


def summary(done: Calibrated) -> list[str]:
    """What came out, in a few sentences."""
    report = done.report
    groups: dict[str, list[str]] = {"well": [], "partly": [], "hardly": [], "pushed": [], "bound": []}
    for p, place in zip(report.parameters, report.z, strict=False):
        pushed = "pushed" if abs(place) > OUTER else "hardly"
        groups["bound" if p.at_bound else pushed if p.identified == "hardly" else p.identified].append(p.name)
    said = [
        f"The fitted model explains {max(share, 0):.0%} of what {name} did: it lacks something, for which its"
        " parameters make up, and neither they nor their intervals are to be believed."
        for name, share in _explained(done).items()
        if share < POOR
    ]
    for kind, words in (
        ("well", "The recording tells {} well."),
        ("partly", "It tells {} in part."),
        ("hardly", "It hardly tells {}: what is given for them is mostly the prior."),
        ("pushed", "It pushes {} to an end of the range, as far as it tells: the interval ends where the range does."),
    ):
        if groups[kind]:
            said.append(words.format(", ".join(groups[kind])))
    bound = groups["bound"]
    if bound:
        said.append(
            f"{', '.join(bound)} {'lies' if len(bound) == 1 else 'lie'} on a bound of the range: either the range is"
            " too narrow, or the model lacks something that the parameter makes up for."
        )
    slow = [name for name, one in report.outputs.items() if one.slow_noise > one.noise]
    if slow:
        said.append(
            f"What is left of {', '.join(slow)} is slow and larger than its sensor's noise: the model lacks something."
        )
    if report.occupancy == "unknown":
        said.append(
            "Nobody counted the persons: how many there were was inferred along with the parameters, with the"
            " description's idea of how such a room is used. What depends on them is as uncertain as that idea, above"
            " all what a person emits: count persons if the parameters matter."
        )
    elif report.replay:
        said.append(
            "Actuators were replayed: what their meters get wrong drives the model; take the intervals with care."
        )
    said.append(
        f"Intervals are about {report.widened:g} times as wide as the recording alone makes them, because a building is"
        " not the model. For a gap that the model does not explain they do not allow."
    )
    if not report.converged:
        said.append(
            "The fit had not come to rest when it stopped: values are means of its last rounds, and intervals allow for"
            " what they still moved by. Take its figures with care."
        )
    return said


def _explained(done: Calibrated) -> dict[str, float]:
    """Share of the variance of each fitted output that the model explains with the most likely nuisance."""
    problem, shares = done.problem, {}
    for k, name in enumerate(problem.system.output_names):
        seen = problem.observed[k]
        if seen.any():
            measured = problem.measured[k, seen]
            left = measured - done.fit.around.outputs[k, seen]
            shares[name] = 1 - float(np.mean(left**2) / max(float(np.var(measured)), 1e-300))
    return shares


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
        panel.set_ylabel(f"{name} [{unit}]")
        if not done.report.outputs[name].used:
            panel.set_title("replayed: drives the model, not fitted", fontsize=8, loc="right")
    panels[0].legend(loc="upper right", ncols=2, fontsize=8)
    panels[-1].set_xlabel(f"days since {began(done)}")
    return embedded(made)


def _residuals(done: Calibrated) -> str:
    problem = done.problem
    names = [name for name, one in done.report.outputs.items() if one.used]
    made, panels = figure(len(names), height=1.7)
    for panel, name in zip(panels, names, strict=True):
        k = problem.system.output_names.index(name)
        left = problem.measured[k] - done.fit.around.outputs[k]
        band = 1.96 * problem.noise.white[k]
        panel.axhspan(-band, band, color=GREY, alpha=0.2, lw=0)
        panel.plot(_days(done), left, lw=0.8, color=RED)
        panel.set_ylabel(f"{name} [{problem.system.outputs[k].unit}]")
    panels[-1].set_xlabel(f"days since {began(done)}")
    return embedded(made)


def _parameters(done: Calibrated) -> str:
    """Prior, posterior and zero-shot estimate, each parameter in its own range."""
    report, system = done.report, done.problem.system
    made, (panel,) = figure(1, height=0.42 * len(report.parameters) + 0.4)
    for row, (one, described) in enumerate(zip(report.parameters, system.parameters, strict=True)):

        def place(value: float, described=described) -> float:  # noqa: ANN001
            low, high = described.min, described.max
            if described.scale == "log":
                low, high, value = np.log(low), np.log(high), np.log(value)
            return float((value - low) / (high - low))

        panel.plot([0, 1], [row, row], lw=7, color=GREY, alpha=0.2, solid_capstyle="butt")
        colour = RED if one.at_bound else BLUE
        panel.plot([place(one.low), place(one.high)], [row, row], lw=4, color=colour, solid_capstyle="butt")
        panel.plot(place(one.value), row, "o", color=colour, ms=6)
        if one.zero_shot is not None:
            panel.plot(place(one.zero_shot), row, "D", color=ORANGE, ms=5)
        panel.text(-0.01, row, f"{one.prior_min:g}", ha="right", va="center", fontsize=7)
        panel.text(
            1.01, row, f"{one.prior_max:g} {'' if one.unit == '1' else one.unit}", ha="left", va="center", fontsize=7
        )
    panel.set_yticks(range(len(report.parameters)), [one.name for one in report.parameters], fontsize=8)
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


def _inputs(done: Calibrated) -> str:
    """What drove the model: inputs that move, and the persons that were found where nobody counted them."""
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
    ][:_MANY]
    made, panels = figure(max(len(moving) + len(found), 1), height=1.3)
    for panel, (one, values) in zip(panels, moving, strict=False):
        shown, unit = readable(values, one.unit)
        panel.plot(_days(done), shown, lw=0.9, color=GREY)
        panel.set_ylabel(f"{one.name}\n[{unit}]", fontsize=8)
    levels = done.problem.values(done.fit.z)[problem.size - len(nuisance.levels) :]
    for panel, (place, (begin, heights)) in zip(panels[len(moving) :], found.items(), strict=True):
        level = next((x for one, x in zip(nuisance.levels, levels, strict=True) if one.column == place), 1.0)
        grid = np.arange(problem.drive.start, problem.drive.stop, 0.5 * HOUR)
        persons = np.zeros(len(grid))
        persons[np.searchsorted(grid, begin - 1.0)] = level * heights
        signal = Piecewise(grid, persons, "previous")
        panel.step((grid - grid[0]) / DAY, signal.at(grid), where="post", lw=0.9, color=ORANGE)
        panel.set_ylabel(f"{system.inputs[place].name}\ninferred", fontsize=8)
    panels[-1].set_xlabel(f"days since {began(done)}")
    return embedded(made)
