"""The search for the cause: base model and candidates as rivals, then, if more is left, a second effect.

Forward selection with the family's own null at each stage (Bacher and Madsen 2011 select grey-box models by
likelihood ratios; the null here is that of twins, Johansson 2014, and holds for all candidates together). Whether there
is a gap at all is asked at the base model's fit; which candidate explains it, of fits that begin together
(:mod:`.refit`).
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
    blamed,
    reason,
    said_by,
)
from diagnosis.fitting.lines import Linearised, applicable, fewer, linearised
from diagnosis.fitting.refit import Refit, linear_start, refit, settled
from diagnosis.fitting.starting import Begun
from diagnosis.gap.evidence import Made, Ranked, Search, evidence_before, worth
from diagnosis.gap.rivals import Rivals, from_one_start, on_the_best_line
from diagnosis.gap.scan import NEGLIGIBLE
from diagnosis.gap.stages import CLEAR, STRONG, Stage, examine
from shared.errors import TimeUp
from shared.logs import logger
from shared.numbers import counted

_log = logger(__name__)
FITTED = 4
"""Candidates that are refitted where the best is: the foremost where the base model's fit began."""
BY_LINE = 1
"""And of those that the straight line at the base model's fit puts first."""
NEAR = 50.0
"""Log evidence below the foremost from which a candidate is not refitted again. A large gap is far along a line: beside
causes that explain it another nuisance is likely, and that alone moves evidences by some tens."""
SECOND = 3
"""Candidates that are refitted as a second effect: the foremost on the straight line at the first."""
MOST_NAMES = 6
"""Candidates that may be nearly as plausible as a second effect's best: more would name what nobody has fitted."""
MOST_EFFECTS = 2
PARSIMONY = 0.6
"""A further effect must leave less than this share of what was left without a cause before it."""


def search(
    origin: Begun, effects: Sequence[Effect], observed: np.ndarray, *, seed: int = 0, known: Search | None = None
) -> Search:
    """Search for the effects behind a gap, from the fit of the base model.

    Parameters
    ----------
    effects
        All candidates; those that cannot act here are left out and said why.
    observed
        Readings that count, shape (outputs, steps).
    known
        A search from the same fit among these candidates and others; what does not depend on the others is taken
        from it.
    """
    found = _begun(origin, effects, observed, seed, known)
    why = ""
    while len(found.chosen) < MOST_EFFECTS:
        try:
            if not _extended(found, effects, observed, seed):
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


def _extended(found: Search, effects: Sequence[Effect], observed: np.ndarray, seed: int) -> bool:
    """Whether a search was gone on with by one more effect.

    Raises
    ------
    CandidateError
        If it fails with the foremost candidate: without it, another is the foremost.
    TimeUp
        If the time was up before there was an effect more.
    """
    first = not found.chosen
    if first:
        refits = _first_effect(found)
    else:
        refits = refitted(found.last, found) if found.last.candidate_found else []
        if refits and refits[0].evidence - evidence_before(found) < CLEAR:
            refits = []
    if not refits:
        return False
    stage, best = found.last, refits[0]
    late = best.lin.problem.runner.lifted() if found.unfinished.why else nullcontext()
    with blamed(best.names), late:
        best = settled(best.lin, observed, stage.colours.best)
        lin = renewed_among(best, effects, found)
        after = examine(lin, observed, seed=seed + len(found.stages))
    if not first and not (worth_more(stage, after) and told(stage, refits, after, found.settled[-1])):
        return False
    found.stages.append(after)
    found.refits.append(refits)
    found.settled.append(best)
    if not first:
        found.tried.append(())
    return True


def _first_effect(found: Search) -> list[Refit]:
    """Candidates that explain a gap, the best first; none where no gap is confirmed.

    It is confirmed where the best is strong evidence over the base model on both lines: where the fit began, and where
    that candidate is.

    Raises
    ------
    TimeUp
        If the time was up before the candidates were looked at where the fit began.
    """
    stage = found.last
    if not stage.differs:
        return []
    usable = [one.name for one in stage.lin.effects if one.name not in found.failed]
    start = _at_start(found, stage, usable)
    ones = [one for one in start.refits if one.names[0] in usable]
    found.tried = [[Ranked(one.names, one.evidence) for one in ones]]
    found.failed |= {name: why for name, why in start.failed.items() if name in usable}
    ones = _foremost(ones, stage)
    if not ones:
        found.confirmed = stage.misfits or stage.discrepancy
        return []
    rivals = replace(start, refits=tuple(ones), failed={})
    try:
        rivals = _on_the_best_line(found, rivals, stage)
    except (TimeUp, *FAILURES) as error:
        why = NO_TIME if isinstance(error, TimeUp) else reason(error)
        found.unfinished.why["the candidates where the best of them is"] = why
    found.failed |= rivals.failed
    refits = [one for one in rivals.refits if abs(one.lin.amplitudes[0]) >= NEGLIGIBLE]
    found.compared = Rivals(rivals.base, tuple(refits))
    before = {one.names: one.evidence - start.base.evidence for one in ones}
    gain = min(refits[0].evidence - rivals.base.evidence, before[refits[0].names]) if refits else -np.inf
    found.confirmed = stage.misfits or stage.discrepancy or (stage.candidate_found and gain >= STRONG)
    return refits if found.confirmed and gain >= STRONG else []


def _foremost(ones: Sequence[Refit], stage: Stage) -> list[Refit]:
    """The best where the fit began, and on the straight line at the base model's fit; the best first."""
    near = [one for one in ones if one.evidence > ones[0].evidence - NEAR][:FITTED]
    others = {one.names[0]: one for one in ones[len(near) :]}
    on_line = [stage.lin.effects[j].name for j in stage.scan.order if stage.scan.ratio[j] > 0]
    return [*near, *[others[name] for name in on_line if name in others][:BY_LINE]]


def _at_start(found: Search, stage: Stage, names: Sequence[str]) -> Rivals:
    """All candidates and the base model where its fit began; candidates that nobody asked for may be among them."""
    known = found.made.rivals.get(found.path)
    if known is not None and known[0] >= set(names):
        return known[1]
    found.base.lin.problem.runner.stage("looking at all effects from where the fit began")
    effects = [one for one in stage.lin.effects if one.name in names]
    made = from_one_start(found.line, effects, stage.grams.observed, stage.colours.best)
    found.made.rivals[found.path] = set(names), made
    return made


def _on_the_best_line(found: Search, rivals: Rivals, stage: Stage) -> Rivals:
    """The foremost candidates and the base model on one line, made once."""
    key = (found.path, tuple(one.names[0] for one in rivals.refits))
    if key not in found.made.alike:
        found.base.lin.problem.runner.stage(f"refitting {counted(len(rivals.refits), 'effect')} where the best is")
        found.made.alike[key] = on_the_best_line(rivals, stage.lin.z, stage.grams.observed, stage.colours.best)
    return found.made.alike[key]


def _begun(origin: Begun, effects: Sequence[Effect], observed: np.ndarray, seed: int, known: Search | None) -> Search:
    """A search at its first stage."""
    problem = origin.fit.lin.problem
    usable, why = applicable(problem, effects)
    if known is not None:
        if known.made.first is None:
            raise ValueError("a search that is known has a first stage; expected one that search() made")
        lin = fewer(known.made.first, effects, {*why, *known.made.first.failed})
        stage, lacking, made = examine(lin, observed, seed=seed), "", known.made
    else:
        problem.runner.stage(f"sensitivities of {len(usable)} effects")
        lin, stage, lacking = _first_stage(origin.fit, usable, observed, seed)
        made = Made(first=lin)
    found = Search([stage], origin.fit, origin.line, excluded=why | lin.failed, made=made)
    if lacking:
        found.unfinished.why["the candidates"] = lacking
        found.excluded |= {effect.name: lacking for effect in usable}
    return found


def _first_stage(
    one: Refit, usable: Sequence[Effect], observed: np.ndarray, seed: int
) -> tuple[Linearised, Stage, str]:
    """The base model's fit linearised by all candidates, its stage, and why that is without them ("" if it is not).

    Raises
    ------
    SimulationError
        If it fails without candidates, too.
    """
    runner = one.lin.problem.runner
    try:
        lin = among(one, usable)
        return lin, examine(lin, observed, seed=seed), ""
    except (TimeUp, *FAILURES) as error:
        why = NO_TIME if isinstance(error, TimeUp) else reason(error)
    with runner.lifted() if why == NO_TIME else nullcontext(), said_by(one.lin.problem.recording.path):
        lin = among(one, ())
        return lin, examine(lin, observed, seed=seed), why


def worth_more(before: Stage, after: Stage) -> bool:
    """Whether a further effect leaves enough less without a cause."""
    return after.left_over <= PARSIMONY * before.left_over


def told(before: Stage, refits: list[Refit], after: Stage, alone: Refit) -> bool:
    """Whether a further effect is better than the first ``alone`` with the error that both leave, and one of few.

    A set that goes beyond the refits names what nobody has fitted.
    """
    values = worth(before, refits, after, base=alone).values()
    return max(values) >= CLEAR and sum(one > max(values) - CLEAR for one in values) <= MOST_NAMES


def among(one: Refit, effects: Sequence[Effect]) -> Linearised:
    """A fit linearised by candidates as well."""
    return linearised(one.lin.problem, one.lin.z, one.lin.around, effects, one.lin.by_unknown, one.lin)


def refitted(stage: Stage, found: Search) -> list[Refit]:
    """The most plausible candidates, each refitted with the parameters and with what was chosen before; best first.

    What stands out most from its own twins is always among them, unless nothing is left of it.
    """
    foremost, made = stage.scan.foremost, []
    order = [j for j in stage.scan.order if stage.lin.effects[j].name not in found.failed][:SECOND]
    if foremost is not None and stage.lin.effects[foremost].name in found.failed:
        foremost = None
    if foremost is not None and foremost not in order:
        order.append(foremost)
    for j in order:
        if stage.scan.ratio[j] <= 0:
            continue
        effect = stage.lin.effects[j]
        key = (found.path, effect.name)
        if key in found.made.refits:
            made.append(found.made.refits[key])
            continue
        found.base.lin.problem.runner.stage(f"refitting with {effect.name}")
        # rounded, so that a refit is the same to the last bit whatever candidates are beside it
        start = np.round(linear_start(stage.grams, stage.colours.best, [j]), 9)
        try:
            one = refit(stage.grams, stage.colours.best, start, [effect])
        except FAILURES as error:
            found.failed[effect.name] = reason(error)
            continue
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
    made[key] = lin
    return lin
