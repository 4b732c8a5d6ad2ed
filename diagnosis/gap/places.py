"""Where the gap lies: residual and twins handed to :mod:`diagnosis.where`, with operators for missing sources.

And the stretch that stands out most, as a finding among the others.

What would close a balance: responses of the outputs to pulses of the sources that the system description declares.

A source of heat is one input of the FMU; a trace gas that only persons bring is persons less their heat. Both are
responses at the fitted model, linear in the source; see :class:`shared.variables.Source`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from diagnosis.effects import Nothing
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.lines import felt
from diagnosis.fitting.nuisance import pulses_between
from diagnosis.fitting.problem import Problem
from diagnosis.gap.stages import Stage
from diagnosis.gap.twins import SHOWN
from diagnosis.pages import input_labels, long_named
from diagnosis.recording import DAY, HOUR, Recording
from diagnosis.where import Finding, Operator, Residuals, Where, find_regimes, locate
from diagnosis.where.episodes import period
from diagnosis.where.series import ORDER
from shared.errors import RecordingError
from shared.system import System
from shared.variables import Source

PULSE = 3 * HOUR
"""Length of the pulses of a missing source [s]."""
FOLLOWED = 3 * DAY
"""How long a pulse is followed [s]."""


def operators(problem: Problem, z: np.ndarray, heights: np.ndarray) -> tuple[list[Operator], dict[str, str]]:
    """Operators of all declared sources, and why there is none of the others, by name.

    Where none is declared, persons are one, as far as the system has any.

    Parameters
    ----------
    z, heights
        Unknowns (unknowns,) and heights of the nuisance (pulses,) of the fitted model.
    """
    system = problem.system
    declared = system.sources or [
        Source(name=one.name, description="missing persons", unit=one.unit, input=one.name)
        for one in system.inputs
        if one.source == "occupancy"
    ]
    fitted = dict(zip(problem.names, problem.values(z).tolist(), strict=True))
    found: dict[str, Operator] = {}
    failed: dict[str, str] = {}
    for source in declared:
        if lacking := [name for name in source.less if name not in found]:
            failed[source.name] = f"that of {lacking[0]!r} is not known"
            continue
        try:
            edges, response = _pulses(problem, z, heights, source)
        except FAILURES:
            failed[source.name] = "its simulation fails"
            continue
        for name, amount in source.less.items():
            response = response - amount * found[name].response
        per = fitted[source.per] if isinstance(source.per, str) else source.per
        label = source.description or f"missing {source.name}"
        found[source.name] = Operator(source.name, label, source.unit, response / per, edges)
    return list(found.values()), failed


@dataclass(frozen=True)
class _Held(Nothing):
    """An effect that sets parameters of the FMU, so that the pulses on an input act."""

    held: dict[str, float] = field(default_factory=dict)

    def parameters(self, amplitude: float) -> dict[str, float]:
        """Those of the source [unit of each]."""
        return self.held if amplitude else {}


def _pulses(problem: Problem, z: np.ndarray, heights: np.ndarray, source: Source) -> tuple[np.ndarray, np.ndarray]:
    """Edges of pulses (pulses + 1,) [s] and the response to one unit of the source's input (outputs, steps, pulses)."""
    column = problem.system.input_names.index(source.input)
    edges = np.append(np.arange(problem.drive.start, problem.drive.stop - 1.0, PULSE), problem.drive.stop)
    pulses = pulses_between(edges, column, np.eye(len(edges) - 1), FOLLOWED)
    where, there = problem, z
    if source.parameters:
        where = problem.with_effects([*problem.effects, _Held(f"source {source.name}", held=source.parameters)])
        first = len(problem.system.parameters) + len(problem.effects)
        there = np.concatenate([z[:first], [1.0], z[first:]])
    response = felt(where, there, heights, pulses)
    # a level multiplies all persons, those of the pulses too
    levels = problem.unknown.level_values(z)
    for level, factor in zip(problem.nuisance.levels, levels, strict=True):
        if level.column == column:
            response = response / factor
    return edges, response


def check_places(recording: Recording, observed: np.ndarray) -> None:
    """Refuse what has no places: fewer steps than can be told apart, or no reading but those that begin a course.

    Parameters
    ----------
    observed
        All readings that count, fitted or not, shape (outputs, steps).

    Raises
    ------
    RecordingError
        Naming the file.
    """
    steps = observed.shape[1]
    if steps <= ORDER:
        raise RecordingError(
            f"{recording.path}: has {steps} steps of {recording.step / HOUR:g} h; expected at least {ORDER + 1}"
        )
    if not observed[:, ORDER:].any():
        raise RecordingError(
            f"{recording.path}: no output that counts was measured after the first {ORDER} steps;"
            " expected readings of one throughout"
        )


def place(stage: Stage, observed: np.ndarray, operators: list[Operator]) -> Where:
    """Test where a stage's residual lies.

    Parameters
    ----------
    observed
        All readings that count, fitted or not, shape (outputs, steps).
    """
    problem = stage.lin.problem
    residuals = Residuals(
        time=problem.time,
        observed=np.where(observed, stage.twins.residual, np.nan),
        replicates=stage.twins.residuals,
        names=problem.system.output_names,
        units=[one.unit for one in problem.system.outputs],
        labels=labels_of(problem.system),
    )
    # twins draw persons of their own where nobody is to know of those who were counted
    hidden = {one.name for one in problem.system.inputs if one.source == "occupancy" and problem.occupancy == "unknown"}
    inputs = {k: v for k, v in problem.recording.inputs.items() if float(np.ptp(v)) > 0 and k not in hidden}
    words = input_labels(problem.system)
    return locate(
        residuals,
        inputs={words[name]: series for name, series in inputs.items()},
        regimes=find_regimes(problem.system, inputs, stage.lin.outputs),
        operators=operators,
        left=lambda response: left_of(stage, response),
    )


def labels_of(system: System) -> list[str]:
    """What each output is, with the model's own name where two are the same."""
    long = [one.long_name or one.name for one in system.outputs]
    return [
        long_named(one.name, what) if long.count(what) > 1 else what
        for one, what in zip(system.outputs, long, strict=True)
    ]


def left_of(stage: Stage, response: np.ndarray) -> np.ndarray:
    """What estimation leaves of series that are added to the outputs, shape (outputs, steps, n) [unit of each].

    Parameters and nuisance take up what they can imitate, as they did of the recording and of its twins: most of the
    CO2 of persons, for example, where persons were not counted.
    """
    grams, colours = stage.grams, stage.colours.best
    scores = np.zeros((len(stage.twins.product.score), response.shape[2]))
    for k in grams.channels:
        scores += grams.whitened_columns(k, colours[k]).T @ grams.whitened(k, colours[k], response[k])
    return np.asarray(response - grams.explained(stage.twins.left.inner(scores)))


def stretch(stage: Stage) -> list[Finding]:
    """The episode of a stage, if it is one."""
    one = stage.episode
    if one is None or not stage.episodic:
        return []
    problem = stage.lin.problem
    output, time = problem.system.outputs[one.channel], problem.time
    step = problem.recording.step
    when = period(float(time[0]) - step, float(time[one.first]) - step, float(time[one.last]), float(time[-1]))
    return [
        Finding(
            kind="episode",
            channel=output.name,
            label=labels_of(problem.system)[one.channel],
            cell=when | {"statistic": "offset"},
            p_value=max(one.p_value, 1 / (SHOWN + 1)),  # as fine as those of all other places
            direction="measured higher" if one.offset > 0 else "measured lower",
            size=one.offset,
            unit=output.unit,
            t=float(np.sign(one.offset) * np.sqrt(2 * one.ratio)),
        )
    ]
