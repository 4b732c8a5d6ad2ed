"""Fitting afresh with an effect, where the way from the base model's fit to the effect's is bent.

A base model without its cause bends its parameters, and who was in the room, to make up for it. A refit that begins
there goes along straight lines, and where the persons were not counted, or meters drive the model, it can stay far from
the optimum: then another effect fits better that is not the cause, or none does. So a candidate that could be the cause
is also fitted from where the base model's fit began (:mod:`diagnosis.gap.starting`), with the amplitude that the refit
found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import linearised
from diagnosis.gap.nuisances import widened
from diagnosis.gap.refit import Refit, refit
from diagnosis.gap.renewal import settled

ROUNDS = 2
"""Of the fits of a diagnosis: refits go on from there."""
RESTLESS = 4
"""Rounds more of the fits of a diagnosis, while the unknowns still move far: then a fit says nothing yet."""
BENT = 5.0
"""Log evidence by which the optimum on straight lines and the one simulated anew differ where the way is bent."""


def bent(one: Refit, there: Refit) -> bool:
    """Whether a refit's evidence was something else once it had been simulated anew."""
    return abs(there.evidence - one.evidence) > BENT


def fitted_afresh(
    plain: Problem, one: Refit, observed: np.ndarray, colours: dict[int, Colour], begin: np.ndarray | None = None
) -> Refit | None:
    """The effects of a refit, fitted from another start and from the refit's amplitudes: see :func:`fitted_with`."""
    return fitted_with(plain, one.lin.chosen, one.lin.amplitudes, observed, colours, begin)


def fitted_with(
    plain: Problem,
    effects: Sequence[Effect],
    amplitudes: np.ndarray,
    observed: np.ndarray,
    colours: dict[int, Colour],
    begin: np.ndarray | None = None,
) -> Refit | None:
    """Effects fitted with the parameters from a start.

    Parameters
    ----------
    plain
        The problem before its nuisances were widened, with any effects.
    amplitudes
        Where the effects begin, shape (effects,) [scales].
    observed
        Readings that count, shape (outputs, steps).
    colours
        By channel, of the stage at which the refit was made.
    begin
        Unknowns without effects, shape (unknowns,); the middle of the prior if not given.

    Returns
    -------
    Refit or None
        Nothing where the simulation fails.
    """
    problem = plain.with_effects(effects)
    first = len(problem.system.parameters)
    rest = problem.size - len(effects)
    begin = np.zeros(rest) if begin is None else begin
    start = np.concatenate([begin[:first], amplitudes, begin[first:]])
    try:
        found = fit(problem.with_observed(observed), [start], rounds=ROUNDS, restless=RESTLESS)
        wider, around, _ = widened(found.problem, found.around)
        around = wider.linearise(found.z, around.nuisance)  # the fit's own was drawn before its last step
        there = refit(Grams(linearised(wider, found.z, around), observed), colours, found.z, ())
        made = settled(wider, found.z, around, observed, wider.floor, colours, renewals=0)
    except FAILURES:
        return None
    # what is likely on the straight line may be worse than where the fit had come to
    best = made if made.evidence > there.evidence else there
    return replace(best, simulations=found.simulations + wider.simulations + there.simulations + made.simulations)
