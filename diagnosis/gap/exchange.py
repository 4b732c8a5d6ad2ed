"""Two effects found one after the other, each asked again beside the other.

Forward selection keeps what it chose first, however the second effect changes the view: of two causes at once the
first choice may be a third one that looks like both, and the second then corrects it with the size that the first has
spoilt. So the later of two effects is held alone, and the best partner beside it is sought as any second effect is
(sequential replacement: Miller 2002, Subset selection in regression, chapter 3). If that pair, or the held effect
alone, is more plausible, it is the answer, and its later effect is held next, until nothing changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.failures import FAILURES
from diagnosis.gap.contending import Tell, best_of, contended, evidence_before, settled_refit
from diagnosis.gap.refit import linear_start, refit
from diagnosis.gap.search import refitted, renewed_among, told, worth_more
from diagnosis.gap.searched import Search
from diagnosis.gap.stages import CLEAR, examine

ROUNDS = 4
"""Exchanges at most: what still changes then goes round, and the first answer stays."""


def exchanged(
    found: Search,
    effects: Sequence[Effect],
    observed: np.ndarray,
    *,
    seed: int = 0,
    tell: Tell = lambda _: None,
) -> Search:
    """The more plausible search, where two effects were chosen.

    Parameters
    ----------
    effects, observed, seed
        As :func:`diagnosis.gap.search.search` had them.
    """
    if len(found.chosen) != 2:
        return found
    now, count = found, found.simulations
    for _ in range(ROUNDS):
        other = _holding(now, now.chosen[-1], effects, observed, seed, tell)
        if other is None:
            break
        count += other.simulations
        if not _better(other, now):
            if now is not found:  # what was found first here is weighed beside what was found with it
                now = replace(now, beside={0: (other.stages[1], other.refits[1])} if len(other.refits) > 1 else {})
            break
        if len(other.chosen) < 2:
            alone = best_of([*other.refits[0], *found.refits[0]])
            if alone[0].names == other.settled[0].names:  # it is the more plausible one by itself, too
                now = replace(other, refits=[alone], tried=[alone])
            break
        now = other
    else:
        now = found
    return replace(now, simulations=count)


def _holding(
    now: Search,
    held: Effect,
    effects: Sequence[Effect],
    observed: np.ndarray,
    seed: int,
    tell: Tell,
) -> Search | None:
    """The search that chooses an effect first, and what is best beside it; nothing if that cannot be simulated."""
    stage = now.stages[0]
    places = [j for j, one in enumerate(stage.lin.effects) if one.name == held.name]
    if not places:  # alone it cannot be simulated
        return None
    made = replace(now, stages=[stage], refits=[], settled=[], tried=[], beside={}, simulations=0)
    tell(f"looking at what else acts beside {held.name}")
    try:
        key, known = (made.path, held.name), made.made.refits
        if key not in known:
            start = np.round(linear_start(stage.grams, stage.colours.best, places), 9)
            one = known[key] = refit(stage.grams, stage.colours.best, start, [held])
            made.simulations += one.simulations
        alone = known[key]
        refits, best = contended([alone], stage, made, tell)
        while True:
            after = examine(renewed_among(best, effects, made), observed, seed=seed + len(made.stages))
            if made.chosen and not (worth_more(stage, after) and told(stage, refits, after, refits)):
                return made
            made.stages.append(after)
            made.refits.append(refits)
            made.settled.append(best)
            made.tried.append(refits)
            refits, stage = refitted(after, tell, made) if after.candidate_found else [], after
            gain = refits[0].evidence - evidence_before(made) if refits else -np.inf
            if len(made.chosen) == 2 or gain < CLEAR:
                return made
            best = settled_refit(refits[0], stage, made)
    except FAILURES:
        return None


def _better(one: Search, other: Search) -> bool:
    """Whether a search ends clearly more plausibly, or as plausibly with fewer effects; each with what it leaves."""
    value, known = (each.settled[-1].evidence_with(each.last.discrepant) for each in (one, other))
    return value > known + (CLEAR if len(one.chosen) >= len(other.chosen) else 0.0)
