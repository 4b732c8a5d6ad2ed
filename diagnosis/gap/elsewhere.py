"""Other amplitudes of a chosen effect, far from where the steps of its refit ended.

What an effect does need not grow with its amplitude: a timetable that is moved by two hours meets another hour of the
day, a limiter opens. Steps along straight lines then end in the nearest trough. So each chosen effect is simulated with
amplitudes from all over its range, and where one of them, after what the parameters would make up for, promises a
better fit, the refit begins there once more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.failures import FAILURES
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import linearised
from diagnosis.gap.refit import Refit, inner, misfit, refit, rested, step_from

GRID = 16
"""Amplitudes of each effect."""
FAR = 8.0
"""How far they go where an effect's bounds are farther, or infinite [scales]."""
WORTH = 4.0
"""Log likelihood that another trough must gain."""


def grid(effect: Effect) -> np.ndarray:
    """Amplitudes from all over an effect's range, shape (GRID,) [scales]."""
    return np.linspace(max(effect.lower / effect.scale, -FAR), min(effect.upper / effect.scale, FAR), GRID)


def elsewhere(one: Refit, colours: dict[int, Colour]) -> Refit:
    """The refit, or one that began with another amplitude and fits better; its simulations are added."""
    best, count = one, one.simulations
    first = len(one.lin.problem.system.parameters)
    for k, effect in enumerate(one.lin.chosen):
        low, high = (bound[first + k] for bound in inner(best.lin.problem))
        # the effect's own derivative belongs to where it is now, and promises what it does not keep elsewhere
        others = best.lin.by_unknown.copy()
        others[..., first + k] = 0.0
        promised, start = misfit(best.grams, colours) - WORTH, None
        for amplitude in np.clip(grid(effect), low, high):
            z = best.lin.z.copy()
            z[first + k] = amplitude
            try:
                there = linearised(best.lin.problem, z, best.lin.around, (), others, best.lin)
            except FAILURES:
                continue
            count += there.simulations
            grams = Grams(there, one.grams.observed, one.grams)
            value = misfit(grams, colours) - step_from(there, grams, colours)[1]
            if value < promised:
                promised, start = value, z
        if start is None:
            continue
        try:
            begun = linearised(best.lin.problem, start, best.lin.around, (), None, best.lin)
            made = rested(refit(Grams(begun, one.grams.observed, one.grams), colours, start, ()), colours)
        except FAILURES:
            continue
        count += begun.simulations + made.simulations
        if misfit(made.grams, colours) < misfit(best.grams, colours) - WORTH:
            best = replace(made, evidence=made.evidence_with(colours))
    return replace(best, simulations=count)
