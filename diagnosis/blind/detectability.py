"""How much of a sealed gap nothing else can imitate: what anybody could see at all, worked out before any verdict.

A gap that moves the readings by many times their noise may still be one that other parameters, or persons whom nobody
counted, would make as well; nobody can see that part. The rest has a length in units of the sensors' noise: the square
root of twice the log-likelihood ratio that an observer expects who knows the true parameters, the noise and the gap's
shape (Cox and Hinkley 1974, section 9.3). Parameters, uncertain constants and nuisance, with what the meters of
replayed actuators get wrong, are linearised at the truth: what nobody knows of a building may make up for a gap.
Straight lines understate how well parameters do that, so they are fitted to the gap as well, and the shorter length
counts. Candidates are simulated with the amplitude that imitates best, on the true inputs and from the true beginning,
as the gap was: on what was published, with its first day before it and persons at their prior means, the very cause of
a gap would often not imitate it. It is sealed with the answers, so that no verdict has a say in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.effects import Effect
from diagnosis.effects.base import foreseen
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import AMPLITUDE, Colour, Grams, Projected, projected
from diagnosis.gap.linear import Linearised, applicable, linearised, metered
from diagnosis.gap.refit import SETTLED, misfit, refit
from diagnosis.recording import HOUR, read_recording
from shared.errors import SimulationError

FITS = 5
"""Searches for the parameters that imitate a gap, at most."""
ROUNDS = 3
"""How often a candidate is simulated with a better amplitude."""
INSIDE = 0.999
"""Share of the bounds within which the true unknowns are put: the probit of a bound is infinite."""


WAYS = (0.5, -0.5)
"""Amplitudes of a candidate's first simulations [scales], or its bounds if they are less."""

Signature = Callable[[Effect, float], np.ndarray]


def detectability(
    simulator: Simulator, recording: Path, answer: dict[str, Any], effects: Sequence[Effect], signature: Signature
) -> Any:
    """Lengths of a sealed gap beyond what can imitate it.

    Parameters
    ----------
    recording
        As it was published.
    answer
        What is sealed of it; see :func:`diagnosis.blind.make.answer_of`.
    effects
        All candidates.
    signature
        What a candidate of an amplitude [its unit] does to what is sealed as ``base``, shape (outputs, steps) [unit of
        each]; see :meth:`diagnosis.blind.generator.Generator.signature`. It may raise :class:`SimulationError`: such
        a candidate imitates nothing.

    Returns
    -------
    dict
        ``length``: of the gap beyond parameters and nuisance; ``beside``: the same beyond these and one candidate of
        any amplitude that it may have, by candidate. All in standard deviations of the noise.
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
    accuracy = [one.accuracy for one in system.outputs]
    colours = {k: _colour(answer["noise"][name], accuracy[k]) for k, name in enumerate(system.output_names)}
    first = Grams(replace(lin, by_effect=gap[..., None]), problem.observed)

    def beyond(series: np.ndarray) -> Projected:
        lin_ = replace(first.lin, by_effect=series)
        return projected(Grams(lin_, problem.observed, first).total(colours), first.inner.size)

    def trial(amplitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Squares left beside candidates at amplitudes [scales]; better amplitudes, and what these are to leave."""
        made = _made(signature, usable, amplitudes, gap.shape)
        left = beyond(np.concatenate([gap[..., None], made], axis=2))
        own = np.diag(left.information)[1:] + amplitudes**2 / AMPLITUDE**2
        # the share of it that would be best if the response were in proportion
        pairs = zip(usable, amplitudes.tolist(), strict=True)
        shares = np.array([_amplitude(left, k, *pair) for k, pair in enumerate(pairs, 1)])
        rest, hoped = (whole - 2 * x * left.information[0, 1:] + x**2 * own for x in (np.ones_like(shares), shares))
        return np.where(np.isfinite(rest), rest, np.inf), amplitudes * shares, hoped

    whole = float(beyond(gap[..., None]).information[0, 0])
    bounds = np.array([(one.lower / one.scale, one.upper / one.scale) for one in usable]).reshape(-1, 2)
    up, down = (trial(np.clip(way, *bounds.T)) for way in WAYS)
    best = np.where(up[2] <= down[2], up[1], down[1])
    beside = np.minimum(whole, np.minimum(up[0], down[0]))
    for _ in range(ROUNDS):
        rest, better, _ = trial(best)
        beside, best = np.minimum(beside, rest), better
    names = [one.name for one in usable]
    length = min(whole, fitted_square(lin, gap, colours))
    beside = np.clip(beside, 0.0, max(length, 0.0))
    return {
        "length": float(np.sqrt(max(length, 0.0))),
        "beside": dict(zip(names, np.sqrt(beside).tolist(), strict=True)),
    }


def _made(
    signature: Signature, effects: Sequence[Effect], amplitudes: np.ndarray, shape: tuple[int, ...]
) -> np.ndarray:
    """Signatures of candidates at amplitudes [scales], shape (outputs, steps, candidates); of none what fails."""
    made = np.zeros((*shape, len(effects)))
    for k, (one, amplitude) in enumerate(zip(effects, amplitudes.tolist(), strict=True)):
        if amplitude:
            with suppress(SimulationError):
                series = signature(one, amplitude * one.scale)
                made[..., k] = series if np.isfinite(series).all() else 0.0
    return made


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
