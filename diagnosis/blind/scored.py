"""What a score says: the schema of its JSON file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

from pydantic import BaseModel, ConfigDict

DETECTABLE = (
    "A gap is detectable when its length in units of the sensors' noise, beyond all that parameters, constants, meters"
    " and unmeasured occupants can imitate, exceeds that of 95 % of this set's recordings without any effect and with"
    " the same actuators (of twenty or fewer, of all) by as much as an observer needs who knows its shape among as many"
    " as there are candidates (5 % false alarms in all, 90 % power). It was worked out when the set was made, and"
    " sealed."
)
BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Edges of bins of probabilities."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Line(_Table):
    """One figure of ``n`` recordings, with the ends of its 95 % interval; empty where there are none.

    ``hits`` of a share that was counted: the interval is Wilson's, and a bootstrap's of other figures. ``wanted``: the
    least that is wanted, or the most if ``most``.
    """

    what: str
    n: int
    value: float | None = None
    low: float | None = None
    high: float | None = None
    hits: int | None = None
    share: bool = True
    wanted: float | None = None
    most: bool = False


class Bin(_Table):
    """Of what was said with a probability between two ends: the mean of what was said, and how often it was so."""

    what: str
    low: float
    high: float
    said: float
    true: Line


class Score(_Table):
    """All figures; the file's schema is ``schema_version``.

    ``recordings`` were scored, of ``planned`` in the set; ``withheld`` of these were also diagnosed without single
    candidates. ``answers``: how many recordings of each stratum were answered in each way. ``failures``: why there is
    no verdict, by recording; ``left_out_failures``: the same without the true effect.
    """

    schema_version: int = 10
    commands: list[str]
    seed: int
    bootstrap_seed: int
    answers_sha256: str
    verdicts_sha256: str
    program: str
    version: str
    system: str
    recordings: int
    planned: int
    withheld: int
    hours: float
    library: list[str]
    without: list[str]
    failures: dict[str, str]
    left_out_failures: dict[str, str]
    lines: list[Line]
    answers: dict[str, dict[str, int]]
    reliability: list[Bin]


def binned(
    said: Mapping[str, list[tuple[float, bool]]],
) -> Iterator[tuple[str, float, float, list[float], list[bool]]]:
    """Probabilities and whether it was so, by what they are of and by bins: of each that has any, its ends and both."""
    for what, pairs in said.items():
        for low, high in pairwise(BINS):
            some = [(p, true) for p, true in pairs if low <= p and (p < high or high == BINS[-1])]
            if some:
                yield what, low, high, [p for p, _ in some], [true for _, true in some]
