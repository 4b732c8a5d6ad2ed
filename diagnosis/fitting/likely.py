"""The nuisance that is likely at given unknowns: who was in the room, and what came before the recording.

A controller that saturates hides who is in the room: above some number of persons the ventilation holds the CO2, one
more or less leaves no trace, and a line through such a point never leads back to an empty room. So it may leap
(:func:`leapt`): where readings of an hour are far from the simulation, a few other histories of the hours before are
simulated as they are, and kept where they make the readings more plausible.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from datagen.driving.tables import SNAP
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.linear import Linearisation
from diagnosis.fitting.nuisance import SPACING, Nuisance
from diagnosis.fitting.problem import Problem
from diagnosis.recording import HOUR
from shared.errors import SimulationError

FAR = 4.0
"""A reading this far from the simulation [standard deviations of its noise] is worth a leap."""
BEFORE = 2 * HOUR
"""Persons so long before a step may have caused what is seen in it."""
AFTER = 12 * HOUR
"""So long after it a history is judged."""
WORTH = 10.0
"""What it must gain in squared standardised residuals: a few, for having been chosen among some twenty."""
TIMES = 2
"""How often: a second leap mends what the first one moved into the next hours."""
LOOSE = 0.05
"""Share of its prior spread by which a height may be off when it is expressed in standard normal unknowns."""


def leapt(problem: Problem, z: np.ndarray, nuisance: np.ndarray, outputs: np.ndarray) -> np.ndarray:
    """A nuisance (nuisance unknowns,) that is at least as plausible at ``z``, given its simulated ``outputs``."""
    guessed = problem.nuisance.guessed
    if not guessed.any():
        return nuisance
    cost = joint_cost(problem, nuisance, outputs)
    for _ in range(TIMES):
        heights = _other(problem, z, problem.nuisance.heights(nuisance), outputs, guessed)
        if heights is None:
            break
        other = unknowns_of(problem.nuisance, heights)
        try:
            found = problem.simulate(z, problem.nuisance.heights(other))
        except FAILURES:
            break
        if joint_cost(problem, other, found) >= cost:
            break
        nuisance, outputs, cost = other, found, joint_cost(problem, other, found)
    return nuisance


def unknowns_of(nuisance: Nuisance, heights: np.ndarray) -> np.ndarray:
    """Standard normal unknowns that give about these heights (pulses,): the most plausible within :data:`LOOSE`."""
    weight = 1 / (LOOSE * np.maximum(nuisance.sd, 1e-9 * max(nuisance.sd.max(), 1e-300))) ** 2
    weighted = nuisance.factor.T * weight
    system = weighted @ nuisance.factor + np.eye(nuisance.factor.shape[1])
    return np.asarray(np.linalg.solve(system, weighted @ (heights - nuisance.mean)))


def joint_cost(problem: Problem, nuisance: np.ndarray, outputs: np.ndarray) -> float:
    """Squares of standardised residuals and nuisance: minus twice their log density, but for a constant."""
    left = problem.standardised(problem.measured - outputs)
    return float(left @ left + nuisance @ nuisance)


def _squares(problem: Problem, outputs: np.ndarray) -> np.ndarray:
    """Squared standardised residuals by output and step, shape (outputs, steps); zero where nothing was observed."""
    left = (problem.measured - outputs) / problem.noise.sd[:, None]
    return np.asarray(np.where(problem.observed, left, 0.0) ** 2)


def _other(
    problem: Problem, z: np.ndarray, heights: np.ndarray, outputs: np.ndarray, guessed: np.ndarray
) -> np.ndarray | None:
    """Heights that fit better around the worst steps, at most one a day; None where there are none."""
    squares = _squares(problem, outputs)
    total, time, step = squares.sum(axis=0), problem.time, problem.recording.step
    worst = _worst(np.where((squares > FAR**2).any(axis=0), total, 0.0), time)
    if not worst:
        return None
    pulses = problem.nuisance
    near = [guessed & (pulses.end > time[k] - step - BEFORE + SNAP) & (pulses.begin < time[k] - SNAP) for k in worst]
    cases = list(_histories(pulses, heights, near, [guessed & (pulses.end > time[k] - step + SNAP) for k in worst]))
    outcomes = problem.simulate_each([(z, case) for case in cases])
    begins = [time[k] - step - BEFORE for k in worst]
    found = heights.copy()
    for one, begin, end in zip(near, begins, [*begins[1:], np.inf], strict=True):
        rows = (time > begin + SNAP) & (time <= min(end, begin + BEFORE + step + AFTER) + SNAP)
        best = total[rows].sum() - WORTH
        for case, outcome in zip(cases, outcomes, strict=True):
            if isinstance(outcome, SimulationError):
                continue
            value = _squares(problem, outcome)[:, rows].sum()
            if value < best:
                best = value
                found[one] = case[one]
    return None if np.array_equal(found, heights) else found


def _worst(squares: np.ndarray, time: np.ndarray) -> list[int]:
    """The steps with the largest squares that are not zero, at least a day apart, in their order."""
    found: list[int] = []
    for k in np.argsort(-squares, kind="stable"):
        if squares[k] <= 0:
            break
        if all(abs(time[k] - time[other]) >= SPACING - SNAP for other in found):
            found.append(int(k))
    return sorted(found)


def _histories(
    pulses: Nuisance, heights: np.ndarray, near: list[np.ndarray], late: list[np.ndarray]
) -> Iterator[np.ndarray]:
    """Other heights (pulses,), in all spans at once: of all pulses, of the last ones, of each one alone."""
    mean, sd = pulses.mean, pulses.sd
    nobody, usual, more, many = (np.maximum(one, 0.0) for one in (0 * mean, mean, mean + sd, mean + 2 * sd))
    for level in (nobody, usual, more, many):
        for some in (near, [one & other for one, other in zip(near, late, strict=True)]):
            yield np.where(np.any(some, axis=0), level, heights)
    members = [np.flatnonzero(one) for one in near]
    for place in range(max(len(one) for one in members)):
        for level in (nobody, 0.3 * heights, 0.6 * heights, more, many):
            case = heights.copy()
            some = [one[place] for one in members if place < len(one)]
            case[some] = level[some]
            yield case


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


def renewed(problem: Problem, z: np.ndarray, around: Linearisation, *, leaps: bool = False) -> Linearisation:
    """Linearise a problem at ``z`` and at the nuisance that is likely there.

    With ``leaps`` what the line cannot see is tried as well.
    """
    found = moved(problem, z, around)
    if found is None:
        return problem.linearise(z, around.nuisance)
    nuisance, outputs = found
    return problem.linearise(z, leapt(problem, z, nuisance, outputs) if leaps else nuisance)


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
        around = renewed(problem, z, around, leaps=k > 0)
        before, outputs = outputs, problem.simulate(z, problem.nuisance.heights(problem.likely_nuisance(z, around)))
        if k and np.sqrt(np.mean(problem.standardised(outputs - before) ** 2)) < STAYS:
            break
    return around, outputs
