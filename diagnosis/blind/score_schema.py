"""What a score says: the schema of its JSON file, and the reading of one."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from diagnosis.blind import rates
from diagnosis.blind.rates import Figure, Held, Share
from diagnosis.blind.shrinking import Error, Shrinkage
from shared.errors import RecordingError
from shared.reading import read_json, validated


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Rates(_Table):
    """Of recordings of one stratum or several: how many, and of those of one effect how many had it named.

    ``found``: a gap was found; ``top``: the right effect was named first; ``covered``: it is in the set that was named.
    """

    what: str
    found: Share
    top: Share
    covered: Share


class Both(_Table):
    """Of recordings of two causes: a gap found, one of them named first, one named at all, both named."""

    found: Share
    first: Share
    one: Share
    both: Share


class Where(_Table):
    """Of recordings whose gap can be seen: whether it lies where it was said; see :class:`diagnosis.blind.opened.Hit`.

    ``cell``: the sealed gap is larger than average within the first cell; ``chance``: how often the same cell shifted
    in time would hit; ``lift``: median of how much larger its mean square is within.
    """

    channel: Share
    any_channel: Share
    cell: Share
    chance: Figure
    lift: Figure


class Score(_Table):
    """All figures; the file's schema is ``schema_version``.

    ``recordings`` were scored, of ``planned`` in the set; ``withheld`` of these were also asked to be diagnosed without
    single candidates. ``left_out_failures``: why there is no verdict without the true effect, by recording.
    """

    schema_version: int = 9
    commands: list[str]
    seed: int
    bootstrap_seed: int
    answers_sha256: str
    verdicts_sha256: str
    program: str
    version: str
    system: str
    recordings: int
    planned: int = 0
    withheld: int = 0
    hours: float
    library: list[str]
    without: list[str]
    failures: dict[str, str]
    left_out_failures: dict[str, str] = {}
    seconds: Figure
    cpu_seconds: Figure
    right: Share
    visible_definition: str
    detectable_definition: str
    strata: rates.Matrix
    confusion: rates.Matrix
    false_alarms: Share
    named_without_cause: Share
    named_rightly: Share
    effects: list[Rates]
    detectable: list[Rates]
    declared: Rates
    two: Both
    two_detectable: Both
    none_of_these: Share
    none_of_these_unlike: Share
    none_of_these_visible: Share
    left_out: rates.LeftOutScore
    left_out_visible: rates.LeftOutScore
    left_out_unlike: rates.LeftOutScore
    power_by_size: list[rates.Point]
    power_by_gap: list[rates.Point]
    power_by_length: list[rates.Point]
    first_statement: rates.Reliability
    all_statements: rates.Reliability
    brier: Figure
    where: Where
    shrinkage: list[Shrinkage]
    shrinkage_detectable: Shrinkage
    parameters: list[Error]
    parameters_right: list[Error]
    held: list[Held] = []
    names: rates.Names = Field(default_factory=lambda: rates.names([]))


def read_score(path: Path | str) -> Score:
    """Read a ``.json`` that ``blind score`` wrote; a ``RecordingError`` names one that is not."""
    expected = "a file of `diagnosis blind score`"
    return validated(Score, read_json(Path(path), RecordingError, expected), f"{path}", RecordingError, expected)
