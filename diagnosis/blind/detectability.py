"""How much of a sealed gap nothing else can imitate: what anybody could see at all, worked out before any verdict.

A gap that moves the readings by many times their noise may still be one that other parameters, or persons whom nobody
counted, would make as well; nobody can see that part. The rest has a length in units of the sensors' noise: the square
root of twice the log-likelihood ratio that an observer expects who knows the true parameters, the noise and the gap's
shape (Cox and Hinkley 1974, section 9.3). Parameters, uncertain constants and nuisance, with what the meters of
replayed actuators get wrong, are linearised at the truth: what nobody knows of a building may make up for a gap.
Straight lines understate how well parameters do that, so they are fitted to the gap as well, and the shorter length
counts. It is sealed with the answers, so that no verdict has a say in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.effects import Effect
from diagnosis.effects.base import foreseen
from diagnosis.fitting.grams import Colour, Grams, projected
from diagnosis.fitting.lines import Linearised, applicable, linearised, metered
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import SETTLED, misfit, refit
from diagnosis.recording import HOUR, read_recording
from shared.errors import SimulationError

FITS = 5
"""Searches for the parameters that imitate a gap, at most."""
INSIDE = 0.999
"""Share of the bounds within which the true unknowns are put: the probit of a bound is infinite."""


def detectability(
    simulator: Simulator, recording: Path, answer: dict[str, Any], effects: Sequence[Effect]
) -> dict[str, float]:
    """Length of a sealed gap beyond what can imitate it.

    Parameters
    ----------
    recording
        As it was published.
    answer
        What is sealed of it; see :func:`diagnosis.blind.make.answer_of`.
    effects
        All candidates: what a diagnosis that has them foresees.

    Returns
    -------
    dict
        ``length``: of the gap beyond parameters and nuisance [standard deviations of the noise].
    """
    system = simulator.system
    record = read_recording(recording, system)
    problem = Problem(simulator, record, occupancy=answer["occupancy"], replay=answer["replay"])
    low, high = problem.bounds
    z = np.clip(problem.unknowns(answer["parameters"] | answer.get("constants", {})), INSIDE * low, INSIDE * high)
    usable, _ = applicable(problem, effects)
    problem = problem.with_observed(foreseen(usable, record))  # as a diagnosis does
    problem, around = metered(problem, problem.linearise(z))
    lin = linearised(problem, z, around)
    gap = np.stack([np.subtract(answer["clean"][name], answer["base"][name]) for name in system.output_names])
    colours = {k: _colour(answer["noise"][one.name], one.accuracy) for k, one in enumerate(system.outputs)}
    grams = Grams(replace(lin, by_effect=gap[..., None]), problem.observed)
    straight = float(projected(grams.total(colours), grams.inner.size).information[0, 0])
    return {"length": float(np.sqrt(max(min(straight, fitted_square(lin, gap, colours)), 0.0)))}


def fitted_square(lin: Linearised, gap: np.ndarray, colours: dict[int, Colour]) -> float:
    """Squared length of a gap beyond parameters that were fitted to it, nuisance integrated out.

    Twice the log-likelihood ratio, priors included, between the best fit to what the gap (outputs, steps) [unit of
    each] makes of the outputs and the best fit to the outputs without it. Both begin at the truth.
    """
    costs = []
    for made in (lin.outputs + gap, lin.outputs):
        problem = lin.problem.with_measured(made)
        begun = linearised(problem, lin.z, lin.around, (), lin.by_unknown, lin)
        grams, cost = Grams(begun, problem.observed), np.inf
        try:
            for _ in range(FITS):  # each goes on where the last one's steps ended
                grams = refit(grams, colours, grams.lin.z, ()).grams
                before, cost = cost, misfit(grams, colours)
                if cost > before - SETTLED:
                    break
        except SimulationError:
            return float("inf")
        costs.append(cost)
    return 2.0 * (costs[0] - costs[1])


def _colour(noise: dict[str, float], accuracy: float) -> Colour:
    """A sensor's sealed noise, and the model's own accuracy, which is white."""
    white = np.hypot(noise["sd"] * np.sqrt(1 - noise["slow_share"]), accuracy)
    return float(white), float(noise["sd"] * np.sqrt(noise["slow_share"])), noise["hours"] * HOUR
