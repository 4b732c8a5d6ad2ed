"""Refits that may be the best, made comparable: simulated anew, fitted from where the base model's fit began.

A refit goes along straight lines from the base model's fit. Where these prove bent, the foremost are fitted afresh
(:mod:`diagnosis.gap.afresh`); where the best still leaves a gap, or none stands out, all candidates are looked at
from there (:mod:`diagnosis.gap.abroad`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from diagnosis.gap.abroad import UNEXPLAINED as UNEXPLAINED
from diagnosis.gap.abroad import Ranked, abroad
from diagnosis.gap.afresh import bent, fitted_afresh, fitted_with
from diagnosis.gap.refit import Refit
from diagnosis.gap.renewal import settled
from diagnosis.gap.searched import Search
from diagnosis.gap.stages import Stage
from shared.errors import SimulationError

AFRESH = 3
"""Of the refits as many are fitted afresh at most where the way is bent."""
CONTENDING = 50.0
"""Log Bayes factor to the best refit within which another may be the better one where the way is bent."""

Tell = Callable[[str], None]


def contended(refits: list[Refit], stage: Stage, found: Search, tell: Tell) -> tuple[list[Refit], Refit]:
    """Refits, the best first, and the best simulated anew at its optimum.

    Where that shows that the way there was bent, the foremost are fitted afresh as well, and only they are left: what
    straight lines say of the others is no measure beside them.
    """
    first = settled_refit(refits[0], stage, found)
    if found.chosen or not bent(refits[0], first):  # a second effect begins where the first one is in the model
        return refits, first
    made = []
    for one in refits[:AFRESH]:
        if one.evidence < refits[0].evidence - CONTENDING:
            break
        other = afresh(one, stage, found, tell)
        if other is None or other.evidence < one.evidence:
            there = settled_refit(one, stage, found)
            other = there if other is None or other.evidence < there.evidence else other
        made.append(other)
    made.sort(key=lambda one: -one.evidence)
    return made, made[0]


def fitted_abroad(stage: Stage, found: Search, tell: Tell) -> tuple[list[Refit], list[Ranked]]:
    """The foremost candidates where the base model's fit began, fitted from there; and what all are worth there."""
    plain, begin = found.plain, found.begin
    observed, colours = stage.grams.observed, stage.colours.best
    at = np.zeros(plain.with_effects(()).size) if begin is None else begin
    path, made = found.path, []
    if path not in found.made.abroad:
        tell("looking at all effects from where the fit began")
        try:
            found.made.abroad[path] = abroad(plain, at, stage.lin.effects, observed, colours)
        except SimulationError:
            return [], []
        found.simulations += found.made.abroad[path].simulations
    there = found.made.abroad[path]
    for effect, amplitude, start in there.foremost([one.name for one in stage.lin.effects]):
        own, fitted = (path, effect.name), found.made.from_there
        if own not in fitted:
            tell(f"fitting from there with {effect.name}")
            one = fitted[own] = fitted_with(plain, [effect], np.array([amplitude]), observed, colours, start)
            found.simulations += one.simulations if one is not None else 0
        made.append(fitted[own])
    names = {(one.name,) for one in stage.lin.effects}
    ranked = [one for one in there.ranked if one.names in names]
    return best_of([one for one in made if one is not None]), ranked


def best_of(refits: Sequence[Refit]) -> list[Refit]:
    """Refits, the best first, and only the best of each candidate."""
    best = {one.names: one for one in sorted(refits, key=lambda one: one.evidence)}
    return sorted(best.values(), key=lambda one: -one.evidence)


def afresh(one: Refit, stage: Stage, found: Search, tell: Tell) -> Refit | None:
    """A refit's effects fitted from where the base model's fit began, once."""
    key, made = (found.path, one.names), found.made.afresh
    if key not in made:
        tell(f"fitting afresh with {one.names[-1]}")
        other = made[key] = fitted_afresh(found.plain, one, stage.grams.observed, stage.colours.best, found.begin)
        found.simulations += other.simulations if other is not None else 0
    return made[key]


def settled_refit(one: Refit, stage: Stage, found: Search) -> Refit:
    """A refit with all simulated anew where it came to."""
    key, made = (found.path, one.names), found.made.settled
    if key not in made:
        lin = one.lin
        made[key] = settled(
            lin.problem, lin.z, lin.around, stage.grams.observed, lin.problem.floor, stage.colours.best, renewals=1
        )
        found.simulations += made[key].simulations
    return made[key]
