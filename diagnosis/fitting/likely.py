"""The nuisance that is likely at given unknowns: who was in the room, and what came before the recording."""

from __future__ import annotations

import numpy as np

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.linear import Linearisation
from diagnosis.fitting.problem import Problem


def joint_cost(problem: Problem, nuisance: np.ndarray, outputs: np.ndarray) -> float:
    """Squares of standardised residuals and nuisance: minus twice their log density, but for a constant."""
    left = problem.standardised(problem.measured - outputs)
    return float(left @ left + nuisance @ nuisance)


LEAST_FELT = 0.1
"""What moves no reading by more than this share of its noise, with its whole prior spread, is no longer followed."""


def pruned(problem: Problem, around: Linearisation) -> tuple[Problem, Linearisation]:
    """The same problem without history and changes within steps that no reading feels, and its linearisation."""
    nuisance = problem.nuisance
    effect = np.abs(around.response) * nuisance.sd / problem.noise.sd[:, None, None]
    keep = nuisance.guessed | (effect.max(axis=(0, 1), initial=0.0) > LEAST_FELT)
    other = problem.with_nuisance(nuisance.only(keep))
    used = np.abs(nuisance.factor[keep]).any(axis=0)
    response = around.response[:, :, keep]
    return other, Linearisation(
        around.z,
        around.nuisance[used],
        around.heights[keep],
        around.outputs,
        response,
        other.marginal(response),
        around.lasting,
    )


SHARES = (1.0, 0.5, 0.2)
STAYS = 0.03
"""Outputs stay where they move by less than this share of their noise [standard deviations]: no score shows it."""


def moved(problem: Problem, z: np.ndarray, around: Linearisation) -> tuple[np.ndarray, np.ndarray] | None:
    """A nuisance (nuisance unknowns,) that is likely at ``z``, and its outputs (outputs, steps); None if none runs.

    Of the way from the old nuisance to the new one only as much is gone as makes the measurements more plausible: a
    controller that saturates bends the straight line.
    """
    target = problem.likely_nuisance(z, around)
    best: tuple[float, np.ndarray, np.ndarray] | None = None
    for share in SHARES:
        nuisance = around.nuisance + share * (target - around.nuisance)
        try:
            outputs = problem.simulate(z, problem.nuisance.heights(nuisance))
        except FAILURES:
            continue
        cost = joint_cost(problem, nuisance, outputs)
        if best is not None and cost > best[0]:
            break
        best = cost, nuisance, outputs
    return None if best is None else best[1:]


LOOKS = 16
"""How often the nuisance that is likely is looked for, at most, by who has no fit."""


def most_likely(problem: Problem, z: np.ndarray, rounds: int = 1) -> tuple[Linearisation, np.ndarray]:
    """A problem linearised at ``z`` and its most likely nuisance, and its outputs there (outputs, steps).

    Parameters
    ----------
    rounds
        How often it is linearised anew at most; fewer, once the outputs stay as they are (:data:`STAYS`).
    """
    around = problem.linearise(z)
    outputs = around.outputs
    for k in range(rounds):
        found = moved(problem, z, around)
        around = problem.linearise(z, around.nuisance if found is None else found[0])
        before, outputs = outputs, problem.simulate(z, problem.nuisance.heights(problem.likely_nuisance(z, around)))
        if k and np.sqrt(np.mean(problem.standardised(outputs - before) ** 2)) < STAYS:
            break
    return around, outputs
