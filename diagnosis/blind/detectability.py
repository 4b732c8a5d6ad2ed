"""How much of a sealed gap nothing else can imitate: what anybody could see at all, worked out before any verdict.

A gap that moves the readings by many times their noise may still be one that other parameters, or persons whom nobody
counted, would make as well; nobody can see that part. The rest has a length in units of the sensors' noise: the square
root of twice the log-likelihood ratio that an observer expects who knows the true parameters, the noise and the gap's
shape (Cox and Hinkley 1974, section 9.3). It is linearised at the truth and sealed with the answers, so that no verdict
has a say in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from datagen.simulator import Simulator
from diagnosis.effects import Effect
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import AMPLITUDE, Colour, Grams, Projected, projected
from diagnosis.gap.linear import applicable, linearised
from diagnosis.recording import HOUR, read_recording

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
    z = np.clip(problem.unknowns(answer["parameters"]), INSIDE * low, INSIDE * high)
    usable, _ = applicable(problem, effects)
    lin = linearised(problem, z, problem.linearise(z), usable)
    gap = np.stack([np.subtract(answer["clean"][name], answer["base"][name]) for name in system.output_names])
    lin = replace(lin, by_effect=np.concatenate([gap[..., None], lin.by_effect], axis=2))
    grams = Grams(lin, problem.observed)
    accuracy = [one.accuracy for one in system.outputs]
    colours = {k: _colour(answer["noise"][name], accuracy[k]) for k, name in enumerate(system.output_names)}
    left = projected(grams.total(colours), grams.inner.size)
    return {
        "length": float(np.sqrt(max(left.information[0, 0], 0.0))),
        "beside": {one.name: _beside(left, k, one) for k, one in enumerate(usable, 1) if one.name not in lin.failed},
    }


def _colour(noise: dict[str, float], accuracy: float) -> Colour:
    """A sensor's sealed noise, and the model's own accuracy, which is white."""
    white = np.hypot(noise["sd"] * np.sqrt(1 - noise["slow_share"]), accuracy)
    return float(white), float(noise["sd"] * np.sqrt(noise["slow_share"])), noise["hours"] * HOUR


def _beside(left: Projected, k: int, effect: Effect) -> float:
    """Length of the gap (place 0) that a candidate (place k) leaves at its best amplitude."""
    own = left.information[k, k] + 1 / AMPLITUDE**2
    both = left.information[0, k]
    amplitude = np.clip(both / own, effect.lower / effect.scale, effect.upper / effect.scale)
    square = left.information[0, 0] - 2 * amplitude * both + amplitude**2 * own
    return float(np.sqrt(max(square, 0.0)))
