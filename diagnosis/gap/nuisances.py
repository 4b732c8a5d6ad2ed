"""What a fit may leave out and a test may not: how wide the nuisances really are.

- Replayed actuators are read by meters, and what the meters get wrong drives the model: each replayed input gets pulses
  whose prior is what is not known of it once its noise is cleared (:mod:`diagnosis.fitting.meters`).
- When within a step people came and went has heavier tails than the normal prior of
  :mod:`diagnosis.fitting.within_steps`, and a quickly ventilated room remembers the end of a step better than its mean:
  the prior is widened, and the second half of a step gets halves of its own, lest a short absence pass for a gap.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis.fitting.answers import responses
from diagnosis.fitting.gaussian import root
from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.meters import Cleared
from diagnosis.fitting.nuisance import FIELDS, SPACING, Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.recording import DAY, HOUR, Recording

PULSE = 3 * HOUR
FOLLOWED = 3 * DAY
WITHIN = 2.0
"""By how much the prior of changes within a step is widened."""


def widened(problem: Problem, around: Linearisation) -> tuple[Problem, Linearisation]:
    """A problem and its linearisation with nuisances as wide as they are."""
    nuisance = problem.nuisance
    wider = np.where(nuisance.turns, WITHIN, 1.0)[:, None]
    problem = problem.with_nuisance(replace(nuisance, factor=nuisance.factor * wider))
    columns = np.abs(nuisance.factor[nuisance.turns]).any(axis=0)  # they share none with other pulses
    around = replace(around, nuisance=np.where(columns, around.nuisance / WITHIN, around.nuisance))
    for place, one in enumerate(problem.system.inputs):
        if one.source == "occupancy" and (problem.nuisance.turns & (problem.nuisance.column == place)).any():
            problem, around = _joined(problem, around, late(problem.nuisance, place))
    return metered(problem, around)


def metered(problem: Problem, around: Linearisation) -> tuple[Problem, Linearisation]:
    """A problem and its linearisation where what the meters of replayed actuators get wrong is a nuisance, too."""
    driven = problem.drive
    pulse = max(PULSE, problem.recording.step)
    for place, one in enumerate(problem.system.inputs):
        if one.name in driven.meters:
            edges = np.append(np.arange(driven.start, driven.stop - 1.0, pulse), driven.stop)
            pulses = _meter(edges, place, driven.meters[one.name], problem.recording)
            problem, around = _joined(problem, around, pulses)
    return problem, around


def late(nuisance: Nuisance, place: int) -> Nuisance:
    """For each change within a step one more within the step's second half."""
    some = nuisance.turns & (nuisance.column == place)
    begin, end = nuisance.begin[some], nuisance.end[some]
    return Nuisance(
        column=np.full(len(end), place),
        begin=0.5 * (begin + end),
        end=end,
        turns=np.ones(len(end), dtype=bool),
        recorded=np.ones(len(end), dtype=bool),
        mean=np.zeros(len(end)),
        factor=np.diag(nuisance.sd[some]),
        followed=nuisance.followed[some],
    )


def _meter(edges: np.ndarray, place: int, meter: Cleared, recording: Recording) -> Nuisance:
    """Means over pulses of what is not known of a meter's readings once they are cleared."""
    count = len(edges) - 1
    within = np.searchsorted(edges, recording.time - 0.5 * recording.step) - 1
    weights = (within == np.arange(count)[:, None]).astype(float)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1.0)
    covariance = meter.covariance(weights)
    return Nuisance(
        column=np.full(count, place),
        begin=edges[:-1],
        end=edges[1:],
        turns=np.zeros(count, dtype=bool),
        recorded=np.ones(count, dtype=bool),
        mean=np.zeros(count),
        factor=root(covariance + 1e-9 * covariance.max() * np.eye(count)),
        followed=np.full(count, FOLLOWED),
    )


def both(old: Nuisance, pulses: Nuisance) -> Nuisance:
    """Two nuisances, independent of each other."""
    rows, columns = old.factor.shape
    factor = np.zeros((rows + pulses.size, columns + pulses.factor.shape[1]))
    factor[:rows, :columns], factor[rows:, columns:] = old.factor, pulses.factor
    fields = {name: np.concatenate([getattr(old, name), getattr(pulses, name)]) for name in FIELDS}
    return Nuisance(**fields, factor=factor, levels=old.levels)


def felt(problem: Problem, z: np.ndarray, heights: np.ndarray, pulses: Nuisance) -> np.ndarray:
    """Response of the outputs to further pulses, shape (outputs, steps, pulses)."""
    other = problem.with_nuisance(both(problem.nuisance, pulses))
    base = other.simulate(z, np.concatenate([heights, pulses.mean]))
    return responses(
        pulses,
        lambda runs: other.simulate_all([(z, np.concatenate([heights, run])) for run in runs]),
        base,
        problem.time,
    )


def _joined(problem: Problem, around: Linearisation, pulses: Nuisance) -> tuple[Problem, Linearisation]:
    """A problem with further pulses, and what they do to the outputs around a linearisation."""
    response = felt(problem, around.z, around.heights, pulses)
    # where the line is drawn again a day is enough: a hundredth of the square of what they do comes later
    pulses = replace(pulses, followed=np.minimum(pulses.followed, SPACING))
    other = problem.with_nuisance(both(problem.nuisance, pulses))
    return other, replace(
        around,
        heights=np.concatenate([around.heights, pulses.mean]),
        nuisance=np.concatenate([around.nuisance, np.zeros(pulses.factor.shape[1])]),
        response=np.concatenate([around.response, response], axis=2),
    )
