"""``verdict.json`` beside a system's description: what its own rooms told of evidence, answers and intervals.

``diagnosis farm`` makes it of recordings whose cause it knows. So no number that was worked out on recordings stands in
the code: weights and limits of an answer, and how much wider than a fit makes them intervals must be, stand there.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from diagnosis.effects import Effect
from shared.errors import RecordingError
from shared.reading import read_json, validated
from shared.shipped import USUAL, shipped_systems
from shared.system import System

SCHEMA_VERSION = 1
FILE_NAME = "verdict.json"
NOTHING = ("one", "best", "gap", "p", "before", "uncounted", "replay")
"""What the odds of no gap depend on, by the names of :func:`diagnosis.gap.verdict.features`."""
NONE = ("one", "best", "left", "rejected", "unexplained", "excess", "replay")
"""What those of a cause that is no candidate depend on."""
POOLED = "all"
"""The condition that stands for all, where one has too few recordings for limits of its own."""


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


class Answers(_Table):
    """What answers were worth: ``alarms`` to recordings without a cause, what was ``named``, causes ``outside``."""

    alarms: Count
    named: Count
    outside: Count


def _known(weights: dict[str, float]) -> dict[str, float]:
    if unknown := weights.keys() - {*NOTHING, *NONE}:
        raise ValueError(
            f"{', '.join(sorted(unknown))} is no feature; expected some of"
            f" {', '.join((*NOTHING, *NONE))}. Make the file again: `diagnosis farm`"
        )
    return weights


Weights = Annotated[dict[str, float], AfterValidator(_known)]


class Verdicts(_Table):
    """``verdict.json``: how a system's evidence becomes an answer, and what that was worked out on.

    ``nothing`` and ``none``: weights of :data:`NOTHING` and :data:`NONE`; ``power`` of the candidates' evidence.
    ``held``, by :func:`diagnosis.gap.verdict.condition`: a candidate, and none of these, is in the answer's set from
    this probability on; of the answers to a gap that has a cause, the set then holds what is true in a share ``cover``,
    about. ``second``: how often a second effect that is named is a cause. A recording counts for 1 / ``doubt``^2 of
    what its fit makes of it: then 90 % intervals of parameters cover in a share ``cover``, where the cause was found.
    ``strata``: recordings by what they were. ``reliability`` and ``answers`` are of recordings that took no part in
    weights and limits. ``candidates_sha256`` is of all that candidates are.
    """

    schema_version: int = SCHEMA_VERSION
    system: str
    system_hash: str
    fmu_sha256: str
    uncertain_sha256: str
    candidates_sha256: str
    version: str
    made: str
    hours: float
    noise: str
    seed: int
    strata: dict[str, int]
    nothing: Weights
    none: Weights
    power: float = Field(gt=0)
    second: float = Field(ge=0, le=1)
    held: dict[str, float]
    cover: float = Field(ge=0, le=1)
    doubt: float = Field(ge=1)
    reliability: list[Count]
    answers: Answers

    @property
    def recordings(self) -> int:
        """How many recordings the weights were fitted to."""
        return sum(self.strata.values())


def candidates_sha256(effects: Sequence[Effect]) -> str:
    """The sha256 of what candidates are: of declared ones the declaration, of others what they say of themselves."""
    said = []
    for one in effects:
        spec = getattr(one, "spec", None)
        declared = spec.model_dump(mode="json") if isinstance(spec, BaseModel) else {}
        said.append([one.name, one.kind, one.unit, one.scale, one.lower, one.upper, declared])
    return hashlib.sha256(json.dumps(said, sort_keys=True, default=str).encode()).hexdigest()


def verdicts_of(system: System, effects: Sequence[Effect], fmu_sha256: str, noise: str) -> tuple[Verdicts, str]:
    """How a system's evidence becomes an answer, and, where that was worked out on something else, what ("" if not).

    It is the file beside the system's description, if that is of this system; otherwise that of the default system.

    Parameters
    ----------
    effects
        All candidates of the system.
    noise
        The preset that a recording is diagnosed with.

    Raises
    ------
    RecordingError
        If a file cannot be read.
    """
    found, why = _nearest(system)
    if why:
        return found, why
    others = {
        "version of the description": (found.system_hash, system.hash()),
        "version of the FMU": (found.fmu_sha256, fmu_sha256),
        "choice of candidates": (found.candidates_sha256, candidates_sha256(effects)),
        "noise preset": (found.noise, noise),
    }
    differing = [what for what, (of_file, here) in others.items() if of_file != here]
    return found, f"{FILE_NAME} is of another {', '.join(differing)}" if differing else ""


def doubt_of(system: System) -> float:
    """How much wider than a fit makes them intervals of a system must be; by the same file.

    Raises
    ------
    RecordingError
        If it cannot be read.
    """
    return _nearest(system)[0].doubt


def _nearest(system: System) -> tuple[Verdicts, str]:
    """The file beside a system's description, if it is of that system, or the default system's, and why ("")."""
    path = system.path.parent / FILE_NAME
    why = f"{FILE_NAME} is missing beside {system.path.name}"
    if path.is_file():
        found = read_verdicts(path)
        if system.name == found.system:
            return found, ""
        why = f"{FILE_NAME} is of {found.system}"
    return read_verdicts(shipped_systems()[USUAL] / FILE_NAME), why


def read_verdicts(path: Path) -> Verdicts:
    """Read ``verdict.json``.

    Raises
    ------
    RecordingError
        If it is no such file.
    """
    expected = "what `diagnosis farm` of this version writes"
    return validated(Verdicts, read_json(path, RecordingError, expected), f"{path}", RecordingError, expected)
