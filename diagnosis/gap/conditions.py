"""How much of an answer unknown occupancy or replayed actuators cost: what could be seen if it were otherwise.

Both comparisons ask the linearised problem for the log-likelihood ratio that a candidate of one scale would be expected
to reach. If persons had been counted: the same problem where of who was there is unknown when within a step they came,
if anything, as of counts that are means over long steps. If the control loops had been simulated: the same recording
linearised anew with them, the actuators' own readings being evidence then.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from datagen.driving.tables import Piecewise
from diagnosis.effects import Effect
from diagnosis.effects.edges import foreseen
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.noise import HOUR
from diagnosis.fitting.nuisance import Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.renewing import pruned
from diagnosis.fitting.within_steps import counted as persons_within
from diagnosis.gap.grams import Colour, Grams, projected
from diagnosis.gap.linear import Linearised, applicable, felt_nuisance, linearised
from diagnosis.gap.nuisances import WITHIN, both, felt, late, widened
from diagnosis.gap.stages import Stage
from shared.errors import RecordingError


@dataclass(frozen=True)
class Otherwise:
    """What would be known under another condition.

    ``condition``: ``counted`` or ``controlled``; ``lin`` and ``observed`` (outputs, steps) what the ratios are of.
    """

    condition: str
    lin: Linearised
    observed: np.ndarray


def otherwise(stage: Stage, whole: Problem, candidates: Sequence[Effect]) -> list[Otherwise]:
    """Better conditions than the recording's; none where persons were counted and the control loops simulated.

    Parameters
    ----------
    stage
        The first, without effects.
    whole
        The recording's problem as it was before the fit.
    """
    found = []
    if whole.occupancy == "unknown":
        found.append(Otherwise("counted", _counted(stage.lin), stage.grams.observed))
    if whole.replay:
        # what the control loops need may not have been recorded, or they cannot follow: nothing to compare with
        with suppress(RecordingError, *FAILURES):
            problem, lin = _controlled(whole, stage.lin.z, candidates)
            found.append(Otherwise("controlled", lin, problem.observed))
    return found


def expected(one: Otherwise, colours: dict[int, Colour], size: np.ndarray) -> dict[str, float]:
    """Log-likelihood ratio that each candidate of one scale would reach, by name.

    Parameters
    ----------
    colours
        Of the channels of the recording's own condition; others have white noise.
    size
        Standard deviation of one reading's error, shape (outputs,) [unit of each].
    """
    grams = Grams(one.lin, one.observed)
    used = {k: colours.get(k, (float(size[k]), 0.0, HOUR)) for k in grams.channels}
    left = projected(grams.total(used), grams.inner.size)
    values = 0.5 * np.diag(left.information)
    return dict(zip([effect.name for effect in one.lin.effects], values.tolist(), strict=True))


def _counted(lin: Linearised) -> Linearised:
    """The same with the most likely persons taken for counted, without their level.

    Derivatives by effects stay as they are: they were simulated with the persons who are most likely, which an effect
    that follows or changes persons sees (:mod:`diagnosis.fitting.runs`).
    """
    nuisance, around = lin.problem.nuisance, lin.around
    keep = ~np.isin(nuisance.column, [level.column for level in nuisance.levels])
    problem, response = lin.problem.with_nuisance(nuisance.only(keep)), around.response[..., keep]
    for level, factor in zip(nuisance.levels, lin.problem.unknown.level_values(lin.z).tolist(), strict=True):
        pulses = _within_steps(lin, level.column, factor)
        if pulses.size:
            answers = felt(lin.problem, lin.z, around.heights, pulses)
            problem = problem.with_nuisance(both(problem.nuisance, pulses))
            response = np.concatenate([response, answers], axis=2)
    by_nuisance, turn = felt_nuisance(problem, replace(around, response=response))
    count = len(lin.z) - len(nuisance.levels)
    return replace(lin, by_nuisance=by_nuisance, turn=turn, by_unknown=lin.by_unknown[..., :count], z=lin.z[:count])


def _within_steps(lin: Linearised, column: int, factor: float) -> Nuisance:
    """What would not be known of the likely persons had their means over steps been counted, before their level."""
    problem, recording = lin.problem, lin.problem.recording
    assert problem.system.occupancy is not None
    begins, nuisance = recording.time - recording.step, problem.nuisance
    some = nuisance.guessed & (nuisance.column == column)
    last = np.minimum(recording.time[:, None], nuisance.end[some])
    shared = np.maximum(last - np.maximum(begins[:, None], nuisance.begin[some]), 0.0)
    means = factor * (shared @ lin.around.heights[some]) / recording.step
    pulses, _ = persons_within(problem.system.occupancy, column, recording, Piecewise(begins, means, "previous"))
    if not pulses.size:
        return pulses
    pulses = both(wider := replace(pulses, factor=WITHIN * pulses.factor), late(wider, column))
    return replace(pulses, factor=pulses.factor / factor)


def _controlled(whole: Problem, z: np.ndarray, candidates: Sequence[Effect]) -> tuple[Problem, Linearised]:
    """The same recording with the control loops simulated, linearised at the same unknowns."""
    problem = Problem(
        whole.simulator,
        whole.recording,
        noise=whole.noise,
        occupancy=None if whole.occupancy == "none" else whole.occupancy,
        warm_up=whole.drive.start - whole.drive.begin,
        runner=whole.runner,
    )
    usable, _ = applicable(problem, candidates)
    problem = problem.with_observed(foreseen(usable, whole.recording))  # as the recording's own readings count
    plain, around = pruned(problem, problem.linearise(z))
    problem, around = widened(plain, around)  # as wide as the recording's own
    return problem, linearised(problem, z, around, usable)
