"""From the search to an answer: no gap, an effect, a set that cannot be told apart, or none of these.

How candidates are weighed against one another, :mod:`diagnosis.gap.weighing` says. That none of the candidates is the
cause is weighed by how much is left: when the best fit is rejected on its own twins, the share of the first gain of a
discrepancy without a cause that is still there, slow (:mod:`diagnosis.gap.colours`) or over a stretch
(:mod:`diagnosis.gap.episode`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from scipy.special import expit

from diagnosis.gap.search import LEVEL, Search
from diagnosis.gap.stages import Stage
from diagnosis.gap.weighing import named, softmax, weighed

Verdict = Literal["effect", "ambiguous", "none_of_these", "no_gap"]

STEEP = 0.13
"""Of the logistic curve through how often what is named holds no true cause, over the share left."""


@dataclass(frozen=True)
class Frequencies:
    """How often what is named holds no true cause, as ``tests/benchmarks/decision.py`` counts it in opened sets.

    That is a little oftener than the cause is no candidate: a wrong candidate that is named is no better than none.
    ``least``: where the best fit is not rejected: another law of another cause can look like it. ``half``: share left
    at which, when it is rejected, it is even whether the cause is one that it does not look like.
    """

    half: float
    least: float

    def other(self, share: float) -> float:
        """Probability of no true cause where the best fit is rejected and leaves so much."""
        return float(self.least + (1 - self.least) * expit((share - self.half) / STEEP))


SIMULATED = Frequencies(half=0.33, least=0.15)
REPLAYED = Frequencies(half=0.38, least=0.3)
"""With replayed actuators all that a cause can show is in fewer channels, and what fits there is the cause less often.
``half`` and STEEP: docs/blind-check.md says which opened sets they are of, and how many fits. ``least`` lies between
what four of them gave, 0.2 and 0.37, and what one gave with 80 of its recordings diagnosed by all readings and with
tempered evidences, 0.1 and 0.27: a named set holds more then."""
NOTHING = 0.37
"""Probability that there is no gap where none is found: most effects of half their usual size go unseen."""


@dataclass(frozen=True)
class Decision:
    """The answer.

    ``probabilities`` by candidate, ``none`` and ``nothing`` (no gap) that there is none; for a single cause they sum
    to 1. ``named`` are the effects of the answer, ``sets`` one for each effect found.
    """

    verdict: Verdict
    probabilities: dict[str, float]
    none: float
    nothing: float
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
    if not gap_found(first, where_p, search.confirmed):
        p_value = first.scan.p_value if search.confirmed else max(first.scan.p_value, LEVEL)
        odds = min(p_value, first.scan.misfit_p) / LEVEL
        nothing = float(NOTHING * odds / (1 + odds))
        chance = softmax(dict(zip((one.name for one in first.lin.effects), first.scan.evidence.tolist(), strict=True)))
        likely = {name: (1 - nothing) * 0.5 * p for name, p in chance.items()}
        return Decision("no_gap", likely, 0.5 * (1 - nothing), nothing, (), (), False)
    rejected = gap_found(last, where_left_p)
    share = search.share_left if search.chosen else 1.0
    usual = REPLAYED if first.lin.problem.replay else SIMULATED
    none = usual.other(share) if rejected else usual.least
    if not search.chosen:
        none = max(none, 0.9)
    probabilities: dict[str, float] = {}
    sets = []
    for k, refits in enumerate(search.refits):
        later = [ones[0].names[-1] for ones in search.refits[k + 1 :]]
        chance = weighed(search.stages[k], refits, search.stages[k + 1], tried=search.tried[k], later=later)
        sets.append(named(chance, refits[0].names[-1]))
        for name, p in chance.items():
            probabilities[name] = max(probabilities.get(name, 0.0), (1 - none) * p)
    if none > 0.5:
        return Decision("none_of_these", probabilities, none, 0.0, (), (), rejected)
    verdict: Verdict = "effect" if all(len(one) == 1 for one in sets) else "ambiguous"
    together = tuple(dict.fromkeys(name for one in sets for name in one))
    return Decision(verdict, probabilities, none, 0.0, together, tuple(sets), rejected)
