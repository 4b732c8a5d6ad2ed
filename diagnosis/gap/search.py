"""The search for the cause: the best candidates refitted with the parameters, then, if more is left, a second effect.

Forward selection with the family's own null at each stage (Bacher and Madsen 2011 select grey-box models by
likelihood ratios; the null here is that of twins, Johansson 2014, and holds for all candidates together).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.failures import (
    FAILURES,
    NO_TIME,
    CandidateError,
    Unfinished,
    blamed,
    reason,
    said_by,
)
from diagnosis.fitting.fit import Fit, fit
from diagnosis.gap.contending import (
    UNEXPLAINED,
    Tell,
    best_of,
    contended,
    evidence_before,
    fitted_abroad,
    stands,
)
from diagnosis.gap.elsewhere import elsewhere
from diagnosis.gap.fewer import fewer
from diagnosis.gap.linear import Linearised, applicable, linearised
from diagnosis.gap.made import Made
from diagnosis.gap.nuisances import widened
from diagnosis.gap.refit import Refit, linear_start, refit, rested
from diagnosis.gap.renewal import RENEWALS, settled
from diagnosis.gap.scan import NEGLIGIBLE
from diagnosis.gap.searched import Search, outdone
from diagnosis.gap.stages import CLEAR, PLAIN, STRONG, Stage, examine
from diagnosis.gap.weighing import Judged, named, weighed
from shared.errors import TimeUp

FURTHER = 5
"""Rounds that the base model's fit gets more where it had not come to rest and a gap seems to be there."""
MOST_REFITS = 6
LEAST_REFITS = 3
NEAR = 8.0
"""Log Bayes factor within which a candidate is as good as the best, as far as a straight line can tell."""
SHARE = 0.5
"""Of the best one's log Bayes factor: a large gap is far along a line, and what is known that far of it is coarse."""
MOST_EFFECTS = 2
PARSIMONY = 0.6
"""A further effect must leave less than this share of what was left without a cause before it."""


def search(
    base: Fit,
    effects: Sequence[Effect],
    observed: np.ndarray,
    *,
    begin: np.ndarray | None = None,
    seed: int = 0,
    tell: Tell = lambda _: None,
    known: Search | None = None,
) -> Search:
    """Search for the effects behind a gap, from the fit of the base model.

    Parameters
    ----------
    effects
        All candidates; those that cannot act here are left out and said why.
    observed
        Readings that count, shape (outputs, steps).
    begin
        Unknowns where the fit began, shape (unknowns,); the middle of the prior if not given.
    known
        A search from the same fit among these candidates and others; what does not depend on the others is taken
        from it.
    """
    found = _followed(_begun(base, effects, observed, begin, seed, tell, known), effects, observed, seed, tell)

    def from_a_better_base() -> Search:
        better = better_base(found)
        if better is None:
            return found
        tell("going on from a better fit of the base model")
        lin = renewed_among(better, effects, found)
        anew = replace(found, stages=[examine(lin, observed, seed=seed)], base=better, confirmed=True)
        anew = replace(anew, refits=[], settled=[], tried=[], bare=[], failed=dict(found.failed))
        anew.excluded = {**found.excluded, **lin.failed}
        return _followed(anew, effects, observed, seed, tell)

    return found.unfinished.attempt("a better fit of the base model", from_a_better_base, found)


def _followed(found: Search, effects: Sequence[Effect], observed: np.ndarray, seed: int, tell: Tell) -> Search:
    """A search gone on with until no effect more is found, without the candidates that fail on the way."""
    why = ""
    while len(found.chosen) < MOST_EFFECTS:
        try:
            if not _extended(found, effects, observed, seed, tell):
                break
        except CandidateError as failure:
            if failure.name in found.failed:
                break
            found.failed[failure.name] = str(failure)
        except (TimeUp, *FAILURES) as error:
            why = NO_TIME if isinstance(error, TimeUp) else reason(error)
            break
    if why:
        found.unfinished.why["the search for a second cause" if found.chosen else "the search for the cause"] = why
    found.searched = bool(found.chosen) or not why
    return found


def _extended(found: Search, effects: Sequence[Effect], observed: np.ndarray, seed: int, tell: Tell) -> bool:
    """Whether a search was gone on with by one more effect.

    Raises
    ------
    CandidateError
        If it fails with the foremost candidate: without it, another is the foremost.
    TimeUp
        If the time was up before there was an effect more. Of a first one that is before all that stand out were
        refitted: after that, the best of them is taken as it is.
    """
    stage, first = found.last, not found.chosen
    gap = first and (stage.misfits or stage.discrepancy)
    refits: list[Refit] = []
    if stage.candidate_found:
        refits = refitted(stage, tell, found)
        gain = refits[0].evidence - evidence_before(found) if refits else -np.inf
        if first:
            found.confirmed = gain >= STRONG or gap
        if not refits or not found.confirmed or (not first and gain < CLEAR):
            return False
    try:
        made = _contended(found, refits, gap, effects, observed, seed, tell)
    except TimeUp:
        if not first or not refits:
            raise
        found.unfinished.why["the refits from elsewhere, and the search for a second cause"] = NO_TIME
        best = refits[0]
        with best.lin.problem.runner.lifted():
            made = refits, best, refits, examine(among(best, ()), observed, seed=seed + 1)
    if made is None:
        return False
    refits, best, tried, after = made
    found.stages.append(after)
    found.refits.append(refits)
    found.settled.append(best)
    found.tried.append(tried)
    return True


def _contended(
    found: Search,
    refits: list[Refit],
    gap: bool,
    effects: Sequence[Effect],
    observed: np.ndarray,
    seed: int,
    tell: Tell,
) -> tuple[list[Refit], Refit, Sequence[Judged], Stage] | None:
    """Refits, the best of them, all that was tried, and the stage with the best; None if none of them stands.

    Parameters
    ----------
    refits
        Of the candidates that stand out, best first.
    gap
        Whether there is a gap whatever the candidates are.
    """
    stage, first = found.last, not found.chosen
    anew: list[Refit] = []
    tried: Sequence[Judged] = refits
    if refits:
        refits, best = contended(refits, stage, found, tell)
        anew = refits if refits is not tried else []  # others that were simulated anew, too
        refits, best = moved(refits, best, stage, found)
        if first and not stands(refits, best, stage, found):
            found.confirmed, refits = gap, []
    looked = first and not refits
    if looked:  # what straight lines point to, if anything, is not the cause; but a gap may be there
        refits, tried = fitted_abroad(stage, found, tell) if gap else ([], [])
        if not refits or refits[0].evidence - evidence_before(found) < PLAIN:
            return None
        refits, best = moved(refits, refits[0], stage, found)
    elif not refits:
        return None
    after = _after(best, effects, found, observed, seed)
    rest = first and not looked and after.left_over > UNEXPLAINED
    again, ranked = fitted_abroad(stage, found, tell) if rest else ([], [])
    if again:
        tried, refits = ranked, best_of([*again, best, *anew])
        if refits[0].lin is not best.lin:
            best = refits[0]
            after = _after(best, effects, found, observed, seed)
    if not first and not (worth_more(stage, after) and told(stage, refits, after, tried)):
        return None
    return refits, best, tried, after


def _after(best: Refit, effects: Sequence[Effect], found: Search, observed: np.ndarray, seed: int) -> Stage:
    """The next stage, with a refit."""
    with blamed(best.names):
        return examine(renewed_among(best, effects, found), observed, seed=seed + len(found.stages))


def _begun(
    base: Fit,
    effects: Sequence[Effect],
    observed: np.ndarray,
    begin: np.ndarray | None,
    seed: int,
    tell: Tell,
    known: Search | None,
) -> Search:
    """A search at its first stage; where what looks like a gap may be a fit that stopped early, after going on with it.

    Whether to go on is asked anew among fewer candidates: some of them may see no gap.
    """
    unfinished = Unfinished()
    if known is not None:
        made, count = known.made, 0
        if made.base is None:
            raise ValueError("a search that is known has a base; expected one that search() made")
        one, lin = made.base
        _, why = applicable(one.lin.problem, effects)
        lin = fewer(lin, effects, {*why, *lin.failed})
        usable: Sequence[Effect] = lin.effects
        stage = examine(lin, observed, seed=seed)
    else:
        made = Made()
        usable, why = applicable(base.problem, effects)
        tell(f"sensitivities of {len(usable)} effects")
        one, lin, stage, lacking = _first_stage(base, usable, observed, seed)
        if lacking:
            unfinished.why["the candidates"] = lacking
            why |= {effect.name: lacking for effect in usable}
        made.base, count = (one, lin), one.simulations + lin.simulations

    def further() -> tuple[Refit, Linearised, Stage]:
        nonlocal count
        if base.converged or not (stage.candidate_found or stage.misfits or stage.episodic):
            return one, lin, stage
        tell("going on with the fit of the base model")
        if made.further is None or known is None:
            more = fit(base.problem, [base.z], rounds=FURTHER, around=base.around)
            other = settled_base(more, observed)
            there = among(other, usable) if other.evidence > one.evidence else None
            count += more.simulations + other.simulations + (there.simulations if there is not None else 0)
            if known is None:
                made.further = other, there
        else:
            other, there = made.further
            there = fewer(there, effects, {*why, *there.failed}) if there is not None else None
        return (one, lin, stage) if there is None else (other, there, examine(there, observed, seed=seed))

    one, lin, stage = unfinished.attempt("going on with the fit of the base model", further, (one, lin, stage))
    found = Search([stage], one, base.problem, begin, excluded=why, simulations=count, made=made, unfinished=unfinished)
    found.excluded |= lin.failed
    return found


def _first_stage(
    base: Fit, usable: Sequence[Effect], observed: np.ndarray, seed: int
) -> tuple[Refit, Linearised, Stage, str]:
    """The base model's fit, linearised by all candidates, its stage, and why that is without them ("" if it is not).

    Where the way to it fails, it is straight from where the fit ended, and at the last without candidates; so it is
    where the time is up, too, which is then not asked for.

    Raises
    ------
    SimulationError
        If all of that fails.
    """
    plans: list[tuple[Sequence[Effect], int]] = [(usable, RENEWALS), (usable, 0), ((), 0)]
    why = ""
    while True:
        some, renewals = plans.pop(0)
        try:
            with base.problem.runner.lifted() if why == NO_TIME else nullcontext():
                one = settled_base(base, observed, renewals=renewals)
                lin = among(one, some)
                return one, lin, examine(lin, observed, seed=seed), "" if some or not usable else why
        except (TimeUp, *FAILURES) as error:
            if not plans:
                with said_by(base.problem.recording.path):
                    raise
            why = NO_TIME if isinstance(error, TimeUp) else reason(error)
            plans = plans[-1:] if why == NO_TIME else plans


def better_base(found: Search) -> Refit | None:
    """A fit of the base model that is more plausible than the one a search began with, where no effect is plain.

    Effects that were fitted elsewhere have shown it: there the model without them may do as well as with them, and
    better than where its own fit had ended. What then looks like a gap is a fit that ended too early.
    """
    if (other := outdone(found)) is None:
        return None
    best, _ = other
    if len(found.refits) > 1 or any(ones[0].evidence - best.evidence >= PLAIN for ones in found.refits):
        return None
    lin = best.lin
    try:
        there = settled(lin.problem, lin.z, lin.around, best.grams.observed, lin.problem.floor)
    except FAILURES:
        return None
    found.simulations += there.simulations
    return there if there.evidence > found.base.evidence + CLEAR else None


def moved(refits: list[Refit], best: Refit, stage: Stage, found: Search) -> tuple[list[Refit], Refit]:
    """Refits and the best of them, where another size of the chosen effects fits better.

    Among the refits it takes its place only if it is more plausible there as well: the others have not come to rest,
    and may promise more than there is.
    """
    with blamed(best.names):
        one = elsewhere(best, stage.colours.best)
    found.simulations += one.simulations - best.simulations
    if one.lin is best.lin:
        return refits, best
    return ([one, *refits[1:]] if one.evidence > refits[0].evidence else refits), one


def at_its_optimum(found: Search) -> Search:
    """The search with the fit of the chosen effects where it comes to rest: what is told of their sizes."""
    if not found.settled:
        return found
    last = found.settled[-1]
    try:
        one = rested(last, found.last.colours.best)
    except FAILURES:
        return found
    more = one.simulations - last.simulations
    return replace(found, settled=[*found.settled[:-1], one], simulations=found.simulations + more)


def worth_more(before: Stage, after: Stage) -> bool:
    """Whether a further effect leaves enough less without a cause."""
    return after.left_over <= PARSIMONY * before.left_over


def told(before: Stage, refits: list[Refit], after: Stage, tried: Sequence[Judged]) -> bool:
    """Whether a further effect is one of few: a set that goes beyond the refits names what nobody has fitted."""
    return len(named(weighed(before, refits, after, tried=tried), refits[0].names[-1])) <= MOST_REFITS


def settled_base(base: Fit, observed: np.ndarray, *, renewals: int = RENEWALS) -> Refit:
    """A fit with its nuisances as wide as they are, linearised where it then is: see :func:`.renewal.settled`."""
    problem, around, count = widened(base.problem, base.around)
    one = settled(problem, base.z, around, observed, problem.floor, renewals=renewals)
    return replace(one, simulations=one.simulations + count)


def among(one: Refit, effects: Sequence[Effect]) -> Linearised:
    """A fit linearised by candidates as well."""
    return linearised(one.lin.problem, one.lin.z, one.lin.around, effects, one.lin.by_unknown, one.lin)


def refitted(stage: Stage, tell: Tell, found: Search) -> list[Refit]:
    """The most plausible candidates, each refitted with the parameters and with what was chosen before; best first.

    What stands out most from its own twins is always among them, unless nothing is left of it.
    """
    best, foremost = stage.scan.evidence.max(initial=-np.inf), stage.scan.foremost
    made = []
    order = [j for j in stage.scan.order if stage.lin.effects[j].name not in found.failed][:MOST_REFITS]
    if foremost is not None and stage.lin.effects[foremost].name in found.failed:
        foremost = None
    if foremost is not None and foremost not in order:
        order[-1] = foremost
    for rank, j in enumerate(order):
        close = rank < LEAST_REFITS or stage.scan.evidence[j] > min(best - NEAR, SHARE * best) or j == foremost
        if not close or stage.scan.ratio[j] <= 0:
            continue
        effect = stage.lin.effects[j]
        key = (found.path, effect.name)
        if key in found.made.refits:
            made.append(found.made.refits[key])
            continue
        tell(f"refitting with {effect.name}")
        # rounded, so that a refit is the same to the last bit whatever candidates are beside it
        start = np.round(linear_start(stage.grams, stage.colours.best, [j]), 9)
        try:
            one = refit(stage.grams, stage.colours.best, start, [effect])
        except FAILURES as error:
            found.failed[effect.name] = reason(error)
            continue
        found.simulations += one.simulations
        found.made.refits[key] = one
        made.append(one)
    made = [one for one in made if abs(one.lin.amplitudes[-1]) >= NEGLIGIBLE]
    return sorted(made, key=lambda one: -one.evidence)


def renewed_among(best: Refit, effects: Sequence[Effect], found: Search) -> Linearised:
    """The best refit linearised by all remaining candidates."""
    usable, _ = applicable(best.lin.problem, effects)
    key, made = (found.path, best.names, best.lin.z.tobytes()), found.made.renewed
    if key in made and {one.name for one in usable} <= {one.name for one in made[key].effects}:
        return fewer(made[key], usable)
    lin = among(best, usable)
    found.simulations += lin.simulations
    made[key] = lin
    return lin
