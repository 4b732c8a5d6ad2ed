"""From evidence to an answer: no gap, a cause, causes that cannot be told apart, or none of these.

Probabilities are those of a conditional logit (McFadden 1974, Frontiers in Econometrics, 105-142) over the hypotheses
that nothing acts, that the cause is no candidate, and each candidate. A candidate's log evidence counts by a power
(Gruenwald 2012, ALT 23:169), because a true cause acts by a law that is not quite its candidate's. The weights and the
limits of an answer are those of a system's ``verdict.json`` (:mod:`diagnosis.verdicts`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import logsumexp

from diagnosis.gap.evidence import Evidence
from diagnosis.verdicts import POOLED, Verdicts

Verdict = Literal["effect", "ambiguous", "none_of_these", "no_gap", "unfinished"]
LIKELY = 0.5
"""A gap that the tests find is answered where no gap is less probable than this."""


@dataclass(frozen=True)
class Probabilities:
    """Of no gap, of none of these, and of each candidate, which sum to one.

    ``beside``: of a second effect's candidates, given that one of them is a cause.
    """

    nothing: float
    none: float
    causes: dict[str, float]
    beside: dict[str, float]


@dataclass(frozen=True)
class Decision:
    """The answer.

    ``probabilities`` by candidate that it is a cause, ``none`` that the cause is none of them and ``nothing`` that
    there is no gap; for a single cause they sum to 1. ``mistaken``: probability that no cause is among what is named
    first. ``named`` are the effects of the answer, ``sets`` one for each effect found; ``or_none``: whether none of
    these is in the set, too. ``possible``: candidates that an answer of none of these does not rule out. ``gap``:
    whether tests find a gap; ``rejected``: whether one is left beside the effects; ``unlike``: whether no effect is
    named because the description is hardly that of the room.
    """

    verdict: Verdict
    probabilities: dict[str, float]
    none: float
    nothing: float
    mistaken: float
    named: tuple[str, ...]
    sets: tuple[tuple[str, ...], ...]
    or_none: bool
    possible: tuple[str, ...]
    gap: bool
    rejected: bool
    unlike: bool


def condition(evidence: Evidence) -> str:
    """What could be measured: whether actuators were replayed and persons counted."""
    return f"{'replay' if evidence.replay else 'control'}, {'counted' if evidence.counted else 'not counted'}"


def limit(limits: Mapping[str, float], evidence: Evidence) -> float:
    """The limit of a recording's condition, or that of all."""
    return limits.get(condition(evidence), limits[POOLED])


def features(evidence: Evidence) -> dict[str, float]:
    """What the odds of no gap and of no candidate depend on, each of order one."""
    best = max(evidence.candidates.values(), default=0.0)
    return {
        "one": 1.0,
        "best": float(np.log1p(max(best, 0.0))),
        "gap": float(evidence.gap),
        "p": float(-np.log10(max(min(evidence.p_values.values(), default=1.0), 1e-4))),
        "before": float(np.log1p(max(evidence.before, 0.0))),
        "left": float(np.log1p(max(evidence.left, 0.0))),
        "rejected": float(evidence.rejected),
        "unexplained": float(evidence.gap and evidence.searched and not evidence.chosen),
        "excess": float(np.log1p(evidence.excess)),
        "replay": float(evidence.replay),
        "uncounted": float(not evidence.counted),
    }


def probabilities(
    evidence: Evidence, nothing: Mapping[str, float], none: Mapping[str, float], power: float
) -> Probabilities:
    """Of every hypothesis, by the weights of a conditional logit.

    Where there is no candidate, there is no gap or the cause is none of them.
    """
    known = features(evidence)
    values = np.array([*evidence.candidates.values()])
    odds = [sum(weight * known[name] for name, weight in nothing.items())]
    odds += [sum(weight * known[name] for name, weight in none.items())]
    odds += (power * (values - values.max())).tolist() if len(values) else []
    no_gap = float(np.exp(odds[0] - logsumexp(odds)))
    chance = ((1 - no_gap) * np.exp(np.array(odds[1:]) - logsumexp(odds[1:]))).tolist()
    # what is no better than the first effect alone is no second one
    others = {name: value for name, value in evidence.beside.items() if value > 0 or name in evidence.chosen[1:]}
    second = power * np.array([*others.values()])
    beside = np.exp(second - logsumexp(second)).tolist() if len(second) else []
    return Probabilities(
        no_gap,
        chance[0],
        dict(zip(evidence.candidates, chance[1:], strict=True)),
        dict(zip(others, beside, strict=True)),
    )


def decide(evidence: Evidence, by: Verdicts, *, own: bool = True) -> Decision:
    """The answer that evidence gives.

    Nothing is named that is less probable than none of these.

    ``own``: whether the verdicts were worked out on this very system. Where they were not, or where a room is beyond
    the description and more is left than is explained, a candidate that is rejected on its own replicates is no answer.
    """
    chance = probabilities(evidence, by.nothing, by.none, by.power)
    held, beside = limit(by.held, evidence), chance.beside

    def answer(verdict: Verdict, *sets: tuple[str, ...]) -> Decision:
        named = tuple(dict.fromkeys(name for one in sets for name in one))
        causes = dict(chance.causes)
        for name, p in beside.items() if sets else ():  # as the one or as the other: it is not both
            causes[name] = min(causes.get(name, 0.0) + by.second * p, 1 - chance.none - chance.nothing)
        first = sum(chance.causes.get(name, 0.0) for name in sets[0]) if sets else 0.0
        return Decision(
            verdict,
            causes,
            chance.none,
            chance.nothing,
            1 - first,
            named,
            sets,
            or_none=bool(sets) and chance.none >= held,
            possible=held_by(chance.causes, (), held) if verdict == "none_of_these" and own else (),
            gap=evidence.gap,
            rejected=evidence.rejected,
            unlike=verdict == "none_of_these" and evidence.excess > 0,
        )

    if not evidence.gap:
        return answer("no_gap")
    if not evidence.searched:
        return answer("unfinished")
    if chance.nothing >= LIKELY:
        return answer("no_gap")
    rejected = evidence.rejected and (not own or evidence.excess > 0)
    sets = [held_by(chance.causes, evidence.chosen[:1], held)]
    if not evidence.chosen or rejected or chance.none > sum(chance.causes.get(name, 0.0) for name in sets[0]):
        return answer("none_of_these")
    if len(evidence.chosen) > 1:
        sets.append(held_by(beside, evidence.chosen[1:2], held))
    return answer("effect" if all(len(one) == 1 for one in sets) else "ambiguous", *sets)


def held_by(chance: Mapping[str, float], chosen: tuple[str, ...], least: float) -> tuple[str, ...]:
    """Candidates from a probability on, the most probable first; what was chosen is always among them."""
    order = sorted(chance, key=lambda name: -chance[name])
    names = tuple(name for name in order if chance[name] >= least)
    return (*names, *(name for name in chosen if name not in names))
