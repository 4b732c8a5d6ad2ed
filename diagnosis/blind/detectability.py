"""How much of a sealed gap nothing else can imitate: what anybody could see at all, worked out before any verdict.

A gap that moves the readings by many times their noise may still be one that other parameters, or persons whom nobody
counted, would make as well; nobody can see that part. The rest has a length in units of the sensors' noise: the square
root of twice the log-likelihood ratio that an observer expects who knows the true parameters, the noise and the gap's
shape (Cox and Hinkley 1974, section 9.3). Parameters, uncertain constants and nuisance, with what the meters of
replayed actuators get wrong, are linearised at the truth: what nobody knows of a building may make up for a gap.
Straight lines understate how well parameters do that, so they are fitted to the gap as well, and the shorter length
counts. Candidates are simulated with the amplitude that imitates best. It is sealed with the answers, so that no
verdict has a say in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.effects import Effect
from diagnosis.fitting.problem import Problem
from diagnosis.gap.abroad import signatures
from diagnosis.gap.grams import AMPLITUDE, Colour, Grams, Projected, projected
from diagnosis.gap.linear import Linearised, applicable, linearised
from diagnosis.gap.nuisances import metered
from diagnosis.gap.refit import SETTLED, misfit, refit
from diagnosis.recording import HOUR, read_recording
from shared.errors import SimulationError

FITS = 5
"""Searches for the parameters that imitate a gap, at most."""
ROUNDS = 3
"""How often a candidate is simulated with a better amplitude."""
INSIDE = 0.999
"""Share of the bounds within which the true unknowns are put: the probit of a bound is infinite."""


def detectability(simulator: Simulator, recording: Path, answer: dict[str, Any], effects: Sequence[Effect]) -> Any:
    """Lengths of a sealed gap beyond what can imitate it.

    Parameters
    ----------
    recording
        As it was published.
    answer
        What is sealed of it; see :func:`diagnosis.blind.make.answer_of`.
    effects
        All candidates.

    Returns
    -------
    dict
        ``length``: of the gap beyond parameters and nuisance; ``beside``: the same beyond these and one candidate of
        any amplitude that it may have, by candidate. All in standard deviations of the noise.
    """
    system = simulator.system
    problem = Problem(
        simulator,
        read_recording(recording, system),
        occupancy=answer["occupancy"],
        replay=answer["replay"],
    )
    low, high = problem.bounds
    z = np.clip(problem.unknowns(answer["parameters"] | answer.get("constants", {})), INSIDE * low, INSIDE * high)
    usable, _ = applicable(problem, effects)
    problem, around = metered(problem, problem.linearise(z))
    lin = linearised(problem, z, around, usable)
    gap = np.stack([np.subtract(answer["clean"][name], answer["base"][name]) for name in system.output_names])
    accuracy = [one.accuracy for one in system.outputs]
    colours = {k: _colour(answer["noise"][name], accuracy[k]) for k, name in enumerate(system.output_names)}
    first = Grams(replace(lin, by_effect=gap[..., None]), problem.observed)

    def beyond(series: np.ndarray) -> Projected:
        lin_ = replace(first.lin, by_effect=series)
        return projected(Grams(lin_, problem.observed, first).total(colours), first.inner.size)

    left = beyond(np.concatenate([gap[..., None], lin.by_effect], axis=2))
    best = np.array([_amplitude(left, k, one) for k, one in enumerate(usable, 1)])
    beside = np.full(len(usable), left.information[0, 0])
    for _ in range(ROUNDS):
        made, _ = signatures(problem.with_effects(usable), lin, best)
        left = beyond(np.concatenate([gap[..., None], made], axis=2))
        size = np.diag(left.information)[1:]
        rest = left.information[0, 0] - 2 * left.information[0, 1:] + size + best**2 / AMPLITUDE**2
        beside = np.minimum(beside, np.where(np.isfinite(rest), rest, np.inf))
        # the amplitude that would be best if the response were in proportion
        best *= [_amplitude(left, k, one, float(a)) for k, (one, a) in enumerate(zip(usable, best, strict=True), 1)]
    names = [one.name for one in usable]
    length = min(float(left.information[0, 0]), fitted_square(lin, gap, colours))
    beside = np.clip(beside, 0.0, max(length, 0.0))
    return {
        "length": float(np.sqrt(max(length, 0.0))),
        "beside": dict(zip(names, np.sqrt(beside).tolist(), strict=True)),
    }


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


def _amplitude(left: Projected, k: int, effect: Effect, unit: float = 1.0) -> float:
    """Best amplitude of a candidate (place k) to imitate the gap (place 0), in ``unit`` scales."""
    if not unit:
        return 0.0
    own = left.information[k, k] + (unit / AMPLITUDE) ** 2
    low, high = sorted((effect.lower / effect.scale / unit, effect.upper / effect.scale / unit))
    return float(np.clip(left.information[0, k] / own, low, high))


def _colour(noise: dict[str, float], accuracy: float) -> Colour:
    """A sensor's sealed noise, and the model's own accuracy, which is white."""
    white = np.hypot(noise["sd"] * np.sqrt(1 - noise["slow_share"]), accuracy)
    return float(white), float(noise["sd"] * np.sqrt(noise["slow_share"])), noise["hours"] * HOUR
