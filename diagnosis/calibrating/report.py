"""The page of a calibration: recording, fit and residuals, parameters before and after, what is identifiable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from datagen.driving.tables import Piecewise
from diagnosis import panels
from diagnosis.calibrating.calibrated import Calibrated
from diagnosis.calibrating.schema import CORRELATED, Calibration, Parameter
from diagnosis.curves import BLUE, GREY, ORANGE, RED, dates, embedded, figure, range_ends, readable
from diagnosis.fitting.runs import LIMIT, within_limit
from diagnosis.pages import long_named, page_environment, within_sentence, write_answer
from diagnosis.panels import Curve, Panel
from diagnosis.physics import hints, warnings
from diagnosis.recording import DAY, HOUR
from shared.numbers import number
from shared.variables import spaced

POOR = 0.5
"""A model that explains less than this share of what an output did is not believed."""
OUTER = 1.28
"""Beyond this [prior standard deviations] a parameter lies in the outer tenths of its range: no prior left it."""
ROUGH = 1.5
"""Noise of readings so many times the declared one is reported."""
FAR = 2.0
"""Beyond this [prior standard deviations] an uncertain constant is not what the description expects."""


def sentences(report: Calibration) -> list[str]:
    """What came out, in a few sentences; first what speaks against all of it."""
    return [*_lacking(report), *_told(report), *_meant(report)]


def _lacking(report: Calibration) -> list[str]:
    """A fit that had no time, outputs that the model does not follow, and constants that are not the description's."""
    unexplained = [
        f"The fitted model explains {max(one.explained, 0):.0%} of what {name} did: it lacks something, and its"
        " parameters compensate. Trust neither them nor their intervals."
        for name, one in report.outputs.items()
        if one.explained is not None and one.explained < POOR
    ]
    stopped = (
        "The time was up before the fit converged: parameters are those where it stopped, with the intervals of an"
        " optimum. The same command with more --minutes continues from there."
    )
    return [*([stopped] if report.stopped else []), *unexplained, *far_outside(_factors(report))]


def far_outside(factors: Mapping[str, tuple[float, float]], model: str = "") -> list[str]:
    """That uncertain constants are far from what the description expects; nothing where none is.

    Parameters
    ----------
    factors
        By name: what a constant is multiplied by, and the standard deviation of its logarithm in the prior.
    model
        Which model they are of, to begin the sentence with.
    """
    said = [
        f"{name} x{factor:.2g} (expected: x{np.exp(-FAR * relative):.2g} to x{np.exp(FAR * relative):.2g})"
        for name, (factor, relative) in factors.items()
        if is_far(factor, relative)
    ]
    if not said:
        return []
    are, they = ("is", "it") if len(said) == 1 else ("are", "them")
    return [
        f"{model}{', '.join(said)} {are} far outside of what the description expects: do not trust parameters that"
        f" depend on {they}."
    ]


def is_far(factor: float, relative: float) -> bool:
    """Whether a factor is beyond :data:`FAR`; ``relative`` is the prior standard deviation of its logarithm."""
    return bool(abs(np.log(factor)) > FAR * relative)


def _factors(report: Calibration) -> dict[str, tuple[float, float]]:
    """Factors of the uncertain constants, and the prior standard deviations of their logarithms.

    A factor is the exponential of its unknown times that; where it does not differ from one, it says nothing of it.
    """
    places = report.z[len(report.parameters) :]
    return {
        one.name: (one.factor, float(np.log(one.factor) / place))
        for one, place in zip(report.constants, places, strict=False)
        if abs(place) > 0
    }


def _told(report: Calibration) -> list[str]:
    """How well the recording identifies each parameter."""
    groups: dict[str, list[Parameter]] = {"well": [], "partly": [], "hardly": [], "pushed": [], "bound": []}
    for p, place in zip(report.parameters, report.z, strict=False):
        pushed = "pushed" if abs(place) > OUTER else "hardly"
        groups["bound" if p.at_bound else pushed if p.identified == "hardly" else p.identified].append(p)
    them = "it" if len(groups["hardly"]) == 1 else "them"
    hardly = f"It hardly identifies {{}}: what is given for {them} is mostly the prior."
    well = "The recording identifies {} well."
    if any(is_far(*one) for one in _factors(report).values()):
        well = "Only with such constants does the recording identify {} as closely as their intervals say."
    said = [
        words.format(_listed(groups[kind]))
        for kind, words in (
            ("well", well),
            ("partly", "It identifies {} in part."),
            ("hardly", hardly),
            (
                "pushed",
                "It pushes {} to an end of the range: the interval ends where the range does.",
            ),
        )
        if groups[kind]
    ]
    bound = groups["bound"]
    if bound:
        said.append(
            f"{_listed(bound)} {'lies' if len(bound) == 1 else 'lie'} on a bound of the range: either the range is"
            " too narrow, or the model lacks something that the parameter compensates for."
        )
        if report.wider:
            said.append(f"{report.wider} has wider ranges: diagnosis calibrate {report.wider} {report.recording}")
    return said


def _listed(ones: Sequence[Parameter]) -> str:
    """Parameters by what they are, with the names that the model has for them."""
    return ", ".join(long_named(one.name, within_sentence(one.description)) for one in ones)


def _meant(report: Calibration) -> list[str]:
    """What the intervals hold and what not."""
    said = []
    slow = [
        name
        for name, one in report.outputs.items()
        if one.slow_noise > (one.noise if name in report.undeclared else one.declared)
    ]
    if slow:
        said.append(
            f"The residual of {', '.join(slow)} is slow and larger than its sensor's noise: the model lacks something."
        )
    rough = [
        f"{name} ({number(one.noise, 3)}{spaced(one.unit)}, declared {number(one.declared, 3)})"
        for name, one in report.outputs.items()
        if name not in report.undeclared and one.noise > ROUGH * one.declared
    ]
    if rough:
        said.append(
            f"The residual of {', '.join(rough)} scatters from reading to reading by more than its sensor's noise:"
            " either that is declared too small, or the model lacks something fast. Intervals allow for it as noise."
        )
    if report.undeclared:
        taken = ", ".join(f"{name} (to {size})" for name, size in report.undeclared.items())
        said.append(
            f"No noise is declared for the sensor of {taken}: readings were taken to be as exact as the model's"
            " numbers, except for the noise that the fit itself found. Declare it in the description's [[outputs]] as"
            " noise.sensor, or under the preset that --noise names."
        )
    if report.occupancy == "unknown":
        said.append(
            "Occupants were not counted: how many there were was inferred along with the parameters, from the"
            " description's occupancy. What depends on them is as uncertain as that, above all the emission of a"
            " person. Count occupants if the parameters matter."
        )
    if report.replay:
        said.append("Actuators were replayed: errors of their meters drive the model, so take the intervals with care.")
    said.append(
        f"Intervals are up to {number(report.widened, 2)} times as wide as the fit makes them, because a building"
        " is not the model. Those of hardly identified parameters are hardly wider, being the prior's. They do not"
        " allow for a gap that the model does not explain."
    )
    if not report.converged:
        said.append("The fit had not converged when it stopped. Take its figures with care.")
    return said


SPAN = 4.0
"""An output is drawn over so many standard deviations of its sensor's noise at least: less is nothing to be seen."""
_MANY = 12
"""Weather inputs and the like that a picture shows at most."""


def write_calibration(done: Calibrated, folder: Path) -> None:
    """Write ``calibration.json`` and ``calibration.html`` into a folder, both or none."""
    write_answer(folder, "calibration", done.report, render(done))


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
        bokeh=panels.library(),
        fit_picture=panels.embedded(_fit(done)),
        parameter_picture=_parameters(done),
        correlation_picture=_correlation(done),
        residual_picture=panels.embedded(_residuals(done), height=110),
        input_picture=panels.embedded(inputs, height=70),
        not_drawn=rest,
    )


def _fit(done: Calibrated) -> list[Panel]:
    problem = done.problem
    time, made = dates(problem.recording.zero, problem.time), []
    for name, one in done.report.outputs.items():
        k = problem.system.output_names.index(name)
        output = problem.system.outputs[k]
        measured, unit = readable(problem.measured[k], output.unit)
        simulated, _ = readable(done.fit.around.outputs[k], output.unit)
        title = long_named(name, output.long_name) + ("" if one.used else ", replayed: drives the model, not fitted")
        curves = [Curve("measured", BLUE, measured, "dots"), Curve("fitted", ORANGE, simulated)]
        made.append(Panel(title, unit, time, curves, span=SPAN * float(problem.floor[k])))
    return made


def _residuals(done: Calibrated) -> list[Panel]:
    problem = done.problem
    time, made = dates(problem.recording.zero, problem.time), []
    for name in [name for name, one in done.report.outputs.items() if one.used]:
        k = problem.system.output_names.index(name)
        band = 1.96 * float(problem.floor[k])
        noise = Curve("two standard deviations of the declared noise", GREY, np.array([[-band], [band]]))
        left = Curve("measured minus fitted", RED, problem.measured[k] - done.fit.around.outputs[k])
        output = problem.system.outputs[k]
        made.append(Panel(long_named(name, output.long_name), output.unit, time, [noise, left]))
    return made


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


def _inputs(done: Calibrated) -> tuple[list[Panel], list[str]]:
    """What drove the model: inputs that move, and the persons that were found where nobody counted them.

    Returns the panels, and the names of inputs that move and are not drawn.
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
    zero, made = problem.recording.zero, []
    for one, values in moving:
        shown, unit = readable(values, one.unit)
        made.append(Panel(one.name, unit, dates(zero, problem.time), [Curve("value", GREY, shown)]))
    levels = done.problem.values(done.fit.z)[problem.size - len(nuisance.levels) :]
    for place, (begin, heights) in found.items():
        level = next((x for one, x in zip(nuisance.levels, levels, strict=True) if one.column == place), 1.0)
        grid = np.arange(problem.drive.start, problem.drive.stop, 0.5 * HOUR)
        persons = np.zeros(len(grid))
        persons[np.searchsorted(grid, begin - 1.0)] = level * heights
        signal = Piecewise(grid, persons, "previous")
        values, unit = signal.at(grid), system.inputs[place].unit
        name, middle = f"{system.inputs[place].name}, inferred", dates(zero, grid + 0.25 * HOUR)
        made.append(Panel(name, unit, middle, [Curve("value", ORANGE, values)], stepwise=True))
    return made, [one.name for one, _ in rest]
