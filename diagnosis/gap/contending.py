"""Refits that may be the best, made comparable: simulated anew, fitted from where the base model's fit began.

A refit goes along straight lines from the base model's fit. Where these prove bent, the foremost are fitted afresh
(:mod:`diagnosis.gap.afresh`); where the best still leaves a gap, or none stands out, all candidates are looked at
from there (:mod:`diagnosis.gap.abroad`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from diagnosis.fitting.failures import FAILURES, blamed
from diagnosis.gap.abroad import UNEXPLAINED as UNEXPLAINED
from diagnosis.gap.abroad import Ranked, abroad
from diagnosis.gap.afresh import bent, fitted_afresh, fitted_with
from diagnosis.gap.bare import bare
from diagnosis.gap.refit import Refit
from diagnosis.gap.renewal import settled
from diagnosis.gap.searched import Search
from diagnosis.gap.stages import STRONG, Stage

AFRESH = 3
"""Of the refits as many are fitted afresh at most where the way is bent."""
CONTENDING = 50.0
"""Log Bayes factor to the best refit within which another may be the better one where the way is bent."""

Tell = Callable[[str], None]


def contended(refits: list[Refit], stage: Stage, found: Search, tell: Tell) -> tuple[list[Refit], Refit]:
    """Refits, the best first, and the best simulated anew at its optimum.

    Where that shows that the way there was bent, the foremost are fitted afresh as well, and only they are left, each
    where it is most plausible: straight lines may have led to the wrong place, or the others to one that is worse.
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
        laid_bare(other, stage, found)
        made.append((max(one, other, key=lambda each: each.evidence), other))
    made.sort(key=lambda pair: -pair[0].evidence)
    return [one for one, _ in made], made[0][1]


def fitted_abroad(stage: Stage, found: Search, tell: Tell) -> tuple[list[Refit], list[Ranked]]:
    """The foremost candidates where the base model's fit began, fitted from there; and what all are worth there."""
    plain, begin = found.plain, found.begin
    observed, colours = stage.grams.observed, stage.colours.best
    at = np.zeros(plain.with_effects(()).size) if begin is None else begin
    path, made = found.path, []
    names = {one.name for one in stage.lin.effects if one.name not in found.failed}
    tried, there = found.made.abroad.get(path, (names, None))
    if there is None or not names <= tried:
        tell("looking at all effects from where the fit began")
        try:
            there = abroad(plain, at, stage.lin.effects, observed, colours)
        except FAILURES:
            return [], []
        found.made.abroad[path] = names, there
        found.simulations += there.simulations
    for effect, amplitude, start in there.foremost(names):
        own, fitted = (path, effect.name), found.made.from_there
        if own not in fitted:
            tell(f"fitting from there with {effect.name}")
            one = fitted[own] = fitted_with(plain, [effect], np.array([amplitude]), observed, colours, start)
            found.simulations += one.simulations if one is not None else 0
        made.append(fitted[own])
    some = [one for one in made if one is not None]
    for one in some:
        laid_bare(one, stage, found)
    ranked = [one for one in there.ranked if one.names[0] in names]
    return best_of(some), ranked


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


def laid_bare(one: Refit, stage: Stage, found: Search) -> None:
    """Fit the base model where a first effect's refit lies, too (:mod:`.bare`)."""
    key, made = (found.path, one.names, one.lin.z.tobytes()), found.made.bare
    if key not in made:
        made[key] = bare(one, found.base, stage.colours.best)
        found.simulations += sum(each.simulations for each in made[key])
    found.bare += made[key]


def settled_refit(one: Refit, stage: Stage, found: Search) -> Refit:
    """A refit with all simulated anew where it came to."""
    key, made = (found.path, one.names), found.made.settled
    if key not in made:
        lin, observed = one.lin, stage.grams.observed
        with blamed(one.names):
            made[key] = settled(
                lin.problem, lin.z, lin.around, observed, lin.problem.floor, stage.colours.best, renewals=1
            )
        found.simulations += made[key].simulations
    return made[key]


def stands(refits: list[Refit], best: Refit, stage: Stage, found: Search) -> bool:
    """Whether a first effect is strong evidence beside the base model where it lies, too, which by far is not asked."""
    value = max(refits[0].evidence, best.evidence)
    if value - evidence_before(found) < CONTENDING:
        laid_bare(best, stage, found)
    return value - evidence_before(found) >= STRONG


def evidence_before(found: Search) -> float:
    """Log evidence of what was chosen so far, its amplitudes within their bounds as those of refits are.

    Of the base model it is that of the best of its fits.
    """
    stage = found.last
    if not found.settled:
        return max([stage.grams.evidence(stage.colours.best), *(one.evidence for one in found.bare)])
    return found.settled[-1].evidence_with(stage.colours.best)
