"""From the search to an answer: no gap, an effect, a set that cannot be told apart, or none of these.

How candidates are weighed against one another, :mod:`diagnosis.gap.weighing` says. That this is mistaken, and what it
points to holds no true cause, is weighed by how much is left: when the best fit is rejected on its own twins, the share
of the first gain of a discrepancy without a cause that is still there, slow (:mod:`diagnosis.gap.colours`) or over a
stretch (:mod:`diagnosis.gap.episode`). A mistake is not yet a cause outside the library: in opened blind sets three in
five were, and in most others the cause was another candidate, which acted by another law than its own or too weakly to
be told. Of those the evidence says nothing, and they get equal shares.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scipy.special import expit

from diagnosis.gap.searched import Search
from diagnosis.gap.stages import LEVEL, Stage
from diagnosis.gap.weighing import named, softmax, weighed

Verdict = Literal["effect", "ambiguous", "none_of_these", "no_gap", "unfinished"]

LEAST = {False: 0.19, True: 0.32}
"""How often what is named holds no true cause where the best fit is not rejected, by whether actuators are replayed:
another law of another cause can look like it, and in replay the controllers, whose answer tells causes apart, say
nothing. This and what follows are frequencies in opened blind sets (docs/blind-check.md), worked out by
``tests/benchmarks/decision.py``; these two are drawn towards their mean by the weight of ten recordings."""
HALF = 0.35
"""Middle of the logistic curve over the share left of a best fit that is rejected. It rises from LEAST, so that what
is named holds a true cause or none with equal chances at a share of 0.25, in replay of 0.15."""
STEEP = 0.2
"""Of that curve."""
OUTSIDE = 0.57
"""Of the mistakes, the share in which the cause is none of the candidates."""
AFTER_ALL = 0.07
"""Of the mistakes, the share in which there is no gap at all."""
BESIDE = 0.85
"""How often each of two effects that are named is a cause (or its set holds one) where not both are mistaken: of 32 in
three opened sets 28. Where one cause acts by another law than its candidate, the second corrects that."""
NOTHING = 0.36
"""Probability that there is no gap where none is found: most effects of half their usual size go unseen."""
UNSEEN_OUTSIDE = 0.31
"""Of the gaps that are not found, the share whose cause is none of the candidates."""


def mistaken_by(share: float, rejected: bool, replay: bool) -> float:
    """Probability that what is named holds no true cause, by the share of the gap that the best fit leaves."""
    least = LEAST[replay]
    return float(least + (1 - least) * expit((share - HALF) / STEEP)) if rejected else least


@dataclass(frozen=True)
class Decision:
    """The answer.

    ``probabilities`` by candidate that it is a cause, ``none`` that the cause is none of them and ``nothing`` that
    there is no gap; for a single cause they sum to 1. ``mistaken``: probability that what the candidates' evidence
    points to holds no true cause; ``none`` and ``nothing`` are parts of it. ``named`` are the effects of the answer,
    ``sets`` one for each effect found.
    """

    verdict: Verdict
    probabilities: dict[str, float]
    none: float
    nothing: float
    mistaken: float
    named: tuple[str, ...]
    sets: tuple[tuple[str, ...], ...]
    rejected: bool


def gap_found(stage: Stage, where_p: float, confirmed: bool = True) -> bool:
    """Whether model and recording differ in any of four ways, each against the same twins.

    A candidate that the straight line finds is a gap if a refit confirmed it (:attr:`.search.Search.confirmed`).
    A place alone is a gap only if a discrepancy without a cause is strong evidence, too: people who come and go within
    a step scatter more widely than the twins' do.
    """
    placed = where_p <= LEVEL / 2 and stage.discrepancy
    return (stage.candidate_found and confirmed) or stage.misfits or stage.episodic or placed


def decide(search: Search, where_p: float, where_left_p: float) -> Decision:
    """Decide.

    Parameters
    ----------
    where_p, where_left_p
        Family-wise p of where the residual lies, of the base model and with the chosen effects.
    """
    first, last = search.stages[0], search.last
    untried = {*search.excluded, *search.failed}  # they are no candidates here
    tried = [one.name for one in first.lin.effects if one.name not in untried]
    if not gap_found(first, where_p, search.confirmed):
        p_value = first.scan.p_value if search.confirmed else max(first.scan.p_value, LEVEL)
        odds = min(p_value, first.scan.misfit_p) / LEVEL
        nothing = float(NOTHING * odds / (1 + odds))
        evidence = dict(zip((one.name for one in first.lin.effects), first.scan.evidence.tolist(), strict=True))
        outside = UNSEEN_OUTSIDE if tried else 1.0
        chance = softmax({name: evidence[name] for name in tried})
        likely = {name: (1 - nothing) * (1 - outside) * p for name, p in chance.items()}
        none = outside * (1 - nothing)
        return Decision("no_gap", likely, none, nothing, none + nothing, (), (), False)
    if not search.searched:  # by straight lines alone, of which refits would say whether they hold
        evidence = dict(zip((one.name for one in first.lin.effects), first.scan.evidence.tolist(), strict=True))
        none = UNSEEN_OUTSIDE  # what is left of one is that of candidates that were not tried, for lack of time
        likely = softmax({name: evidence[name] for name in tried})
        likely = {name: (1 - none - AFTER_ALL) * p for name, p in likely.items()}
        return Decision("unfinished", likely, none, AFTER_ALL, none + AFTER_ALL, (), (), False)
    rejected = gap_found(last, where_left_p)
    share = search.share_left
    mistaken = mistaken_by(share, rejected, last.lin.problem.replay) if search.chosen else 1.0
    nothing = AFTER_ALL * mistaken
    none = OUTSIDE * mistaken if tried else mistaken - nothing  # where nothing was tried, no candidate can be the cause
    even = (mistaken - none - nothing) / max(len(tried), 1)
    one_is = (1 - mistaken) * (BESIDE if len(search.refits) > 1 else 1.0)  # a cause, or of a set that holds one
    causes = dict.fromkeys(tried, 0.0)
    sets = []
    for k, refits in enumerate(search.refits):
        later = [ones[0].names[-1] for ones in search.refits[k + 1 :]]
        chance = weighed(
            search.stages[k],
            refits,
            search.stages[k + 1],
            tried=search.tried[k],
            later=later,
            excluded=untried,
        )
        sets.append(named(chance, refits[0].names[-1]))
        for name, p in chance.items():  # as the one or as the other: it is not both
            causes[name] = min(causes.get(name, 0.0) + one_is * p, 1 - mistaken)
    probabilities = {name: p + (even if name in tried else 0.0) for name, p in causes.items()}
    if mistaken > 0.5:
        return Decision("none_of_these", probabilities, none, nothing, mistaken, (), (), rejected)
    verdict: Verdict = "effect" if all(len(one) == 1 for one in sets) else "ambiguous"
    together = tuple(dict.fromkeys(name for one in sets for name in one))
    return Decision(verdict, probabilities, none, nothing, mistaken, together, tuple(sets), rejected)
