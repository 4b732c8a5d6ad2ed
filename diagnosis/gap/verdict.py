"""From evidence to an answer: no gap, a cause, causes that cannot be told apart, or none of these.

Probabilities are those of a conditional logit (McFadden 1974, Frontiers in Econometrics, 105-142) over the hypotheses
that nothing acts, that the cause is no candidate, and each candidate. A candidate's log evidence counts by a power
(Gruenwald 2012, ALT 23:169), because a true cause acts by a law that is not quite its candidate's. The weights and the
limits of an answer are those of a system's ``verdict.json``, which ``diagnosis farm`` fits to recordings whose cause it
knows: no number of them stands here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.special import logsumexp

from diagnosis.gap.evidence import Evidence
from shared.errors import RecordingError
from shared.reading import read_json, validated
from shared.shipped import USUAL, shipped_systems
from shared.system import System

Verdict = Literal["effect", "ambiguous", "none_of_these", "no_gap", "unfinished"]
SCHEMA_VERSION = 1
FILE_NAME = "verdict.json"
NOTHING = ("one", "best", "gap", "before", "uncounted", "replay")
"""What the odds of no gap depend on, by the names of :func:`features`."""
NONE = ("one", "best", "left", "rejected", "unexplained", "replay")
"""What those of a cause that is no candidate depend on."""
COVER = 0.9
"""What a set that is named beside another cause holds of its probability."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Count(_Table):
    """Of so many answers, what was said and what was true, on average."""

    what: str
    low: float
    high: float
    count: int
    said: float
    true: float


class Verdicts(_Table):
    """``verdict.json``: how a system's evidence becomes an answer, and what that was worked out on.

    ``nothing`` and ``none``: weights of :data:`NOTHING` and :data:`NONE`; ``power`` of the candidates' evidence.
    ``alarm``: a gap is answered where no gap is less probable than this; ``alarms``: the share of recordings without a
    cause in which that may happen. ``held``: candidates and none of these are in the answer's set from this
    probability on, which then holds what is true in a share ``cover`` of the alarms. ``second``: how often a second
    effect that is named is a cause. ``strata``: recordings by what they were; ``reliability`` and ``answers`` are of
    recordings that took no part in the weights.
    """

    schema_version: int = SCHEMA_VERSION
    system: str
    system_hash: str
    fmu_sha256: str
    uncertain_sha256: str
    effects: list[str]
    version: str
    made: str
    hours: float
    noise: str
    seed: int
    strata: dict[str, int]
    nothing: dict[str, float]
    none: dict[str, float]
    power: float = Field(gt=0)
    second: float = Field(ge=0, le=1)
    alarm: float = Field(ge=0, le=1)
    alarms: float = Field(ge=0, le=1)
    held: float = Field(ge=0, le=1)
    cover: float = Field(ge=0, le=1)
    reliability: list[Count]
    answers: dict[str, Count]

    @property
    def recordings(self) -> int:
        """How many recordings the weights were fitted to."""
        return sum(self.strata.values())


@dataclass(frozen=True)
class Probabilities:
    """Of every hypothesis; they sum to one."""

    nothing: float
    none: float
    causes: dict[str, float]


@dataclass(frozen=True)
class Decision:
    """The answer.

    ``probabilities`` by candidate that it is a cause, ``none`` that the cause is none of them and ``nothing`` that
    there is no gap; for a single cause they sum to 1. ``mistaken``: probability that no cause is among what is named.
    ``named`` are the effects of the answer, ``sets`` one for each effect found. ``rejected``: whether a gap is left
    beside them.
    """

    verdict: Verdict
    probabilities: dict[str, float]
    none: float
    nothing: float
    mistaken: float
    named: tuple[str, ...]
    sets: tuple[tuple[str, ...], ...]
    rejected: bool


def verdicts_of(system: System) -> tuple[Verdicts, str]:
    """How a system's evidence becomes an answer, and, where it is another's, why ("" if not).

    It is the file beside the system's description, if that is of this system; otherwise that of the default system.

    Raises
    ------
    RecordingError
        If a file cannot be read.
    """
    path = system.path.parent / FILE_NAME
    why = f"{FILE_NAME} is missing beside {system.path.name}"
    if path.is_file():
        found = read_verdicts(path)
        if found.system_hash == system.hash():
            return found, ""
        why = f"{FILE_NAME} is of another version of {found.system}"
    return read_verdicts(shipped_systems()[USUAL] / FILE_NAME), why


@lru_cache(maxsize=8)
def read_verdicts(path: Path) -> Verdicts:
    """Read ``verdict.json``.

    Raises
    ------
    RecordingError
        If it is no such file.
    """
    expected = "a file of `diagnosis farm`"
    return validated(Verdicts, read_json(path, RecordingError, expected), f"{path}", RecordingError, expected)


def features(evidence: Evidence) -> dict[str, float]:
    """What the odds of no gap and of no candidate depend on, each of order one."""
    best = max(evidence.candidates.values(), default=0.0)
    return {
        "one": 1.0,
        "best": float(np.log1p(max(best, 0.0))),
        "gap": float(evidence.gap),
        "before": float(np.log1p(max(evidence.before, 0.0))),
        "left": float(np.log1p(max(evidence.left, 0.0))),
        "rejected": float(evidence.rejected),
        "unexplained": float(evidence.gap and not evidence.chosen),
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
    chance = np.exp(np.array(odds) - logsumexp(odds)).tolist()
    return Probabilities(chance[0], chance[1], dict(zip(evidence.candidates, chance[2:], strict=True)))


def decide(evidence: Evidence, by: Verdicts, *, searched: bool = True) -> Decision:
    """The answer that evidence gives.

    Parameters
    ----------
    searched
        Whether all candidates that stood out were fitted; otherwise none is named.
    """
    chance = probabilities(evidence, by.nothing, by.none, by.power)
    causes, beside = dict(chance.causes), second_of(evidence, by)
    alarm = evidence.gap and chance.nothing < by.alarm
    for name, p in beside.items():  # as the one or as the other: it is not both
        causes[name] = min(causes.get(name, 0.0) + by.second * p, 1 - chance.none - chance.nothing)

    def answer(verdict: Verdict, *sets: tuple[str, ...]) -> Decision:
        named = tuple(dict.fromkeys(name for one in sets for name in one))
        held = sum(chance.causes[name] for name in sets[0]) if sets else 0.0
        return Decision(verdict, causes, chance.none, chance.nothing, 1 - held, named, sets, evidence.rejected)

    if not evidence.gap or (searched and not alarm):
        return answer("no_gap")
    if not searched:
        return answer("unfinished")
    first = held_by(chance, evidence.chosen[:1], by.held)
    if not evidence.chosen or chance.none > max(chance.causes.values(), default=0.0):
        return answer("none_of_these")
    sets = [first]
    if len(evidence.chosen) > 1:
        sets.append(smallest(beside, evidence.chosen[1]))
    return answer("effect" if all(len(one) == 1 for one in sets) else "ambiguous", *sets)


def held_by(chance: Probabilities, chosen: tuple[str, ...], least: float) -> tuple[str, ...]:
    """Candidates from a probability on, the most probable first; what was chosen is always among them."""
    order = sorted(chance.causes, key=lambda name: -chance.causes[name])
    names = tuple(name for name in order if chance.causes[name] >= least)
    return (*names, *(name for name in chosen if name not in names))


def second_of(evidence: Evidence, by: Verdicts) -> dict[str, float]:
    """Probabilities of a second effect's candidates, given that one of them is a cause."""
    if not evidence.beside:
        return {}
    values = np.array([*evidence.beside.values()]) * by.power
    return dict(zip(evidence.beside, np.exp(values - logsumexp(values)).tolist(), strict=True))


def smallest(chance: Mapping[str, float], chosen: str) -> tuple[str, ...]:
    """The smallest set that holds :data:`COVER` of what is probable, and what was chosen."""
    order = sorted(chance, key=lambda name: -chance[name])
    names = tuple(order[: 1 + int(np.searchsorted(np.cumsum([chance[name] for name in order]), COVER))])
    return names if chosen in names else (*names, chosen)
