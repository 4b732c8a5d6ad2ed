"""Where the gap lies: residual and twins handed to :mod:`diagnosis.where`, with operators for missing sources.

And the stretch that stands out most, as a finding among the others.
"""

from __future__ import annotations

import numpy as np

from diagnosis.gap.stages import Stage
from diagnosis.gap.twins import SHOWN
from diagnosis.pages import long_named
from diagnosis.recording import HOUR, Recording
from diagnosis.where import Finding, Operator, Residuals, Where, find_regimes, locate
from diagnosis.where.colour import ORDER
from diagnosis.where.episodes import period
from shared.errors import RecordingError
from shared.system import System


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
    return locate(
        residuals,
        inputs=inputs,
        measured=problem.measured,
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
