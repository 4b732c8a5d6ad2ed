"""Verdict files: what a diagnosis said of one sealed recording, and all that a score may see of it.

``RESULTS/run.json`` says how the run was made; ``RESULTS/verdicts/*.json`` hold one verdict each with the library of
the run; ``RESULTS/without/*.json`` the verdicts on the same recording with one candidate withheld, by its name.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from shared.errors import RecordingError
from shared.reading import read_json, validated
from shared.store import write_atomically

SCHEMA = "blind-verdict-1"
RUN = "run.json"
VERDICTS = "verdicts"
WITHOUT = "without"

Answer = Literal["effect", "ambiguous", "none_of_these", "no_gap"]
ANSWERS: tuple[Answer, ...] = ("effect", "ambiguous", "none_of_these", "no_gap")
FAILED = "failed"
LIMIT = 3600.0
"""A diagnosis that takes longer is stopped and counts as a failure, unless a run says otherwise [s]."""


class _Table(BaseModel):
    """Verdicts of earlier programs said more."""

    model_config = ConfigDict(extra="ignore")


class Place(_Table):
    """One place where the gap was said to lie, the most certain first."""

    channel: str
    kind: str = "cell"


class Shrunk(_Table):
    """The share of one channel's gap that was removed on the scored part."""

    share: float | None


class Moved(_Table):
    """The ends of a parameter's 90 % intervals, without and with the effect [its unit].

    Those ``after`` are empty where no effect was added, all of them in verdicts from before they were asked for.
    """

    before_low: float | None = None
    before_high: float | None = None
    after_low: float | None = None
    after_high: float | None = None


class Sized(_Table):
    """The ends of the 90 % interval of an effect's amplitude [unit of the effect]."""

    low: float
    high: float


class Verdict(_Table):
    """What a diagnosis said.

    ``probabilities`` by candidate, ``none`` that it is none of them and ``nothing`` that there is no gap; ``named``
    are the effects of the answer (one, or those that cannot be told apart), ``chosen`` what was fitted, of which
    parameters and share of the gap are told, and ``sizes`` those of the effects of the answer.
    """

    verdict: Answer
    probabilities: dict[str, float] = {}
    none: float | None = None
    nothing: float | None = None
    named: list[str] = []
    chosen: list[str] = []
    sizes: dict[str, Sized] = {}
    where: list[Place] = []
    shrinkage: dict[str, Shrunk] = {}
    parameters: dict[str, Moved] = {}

    @property
    def best(self) -> str:
        """The candidate that is named first; empty if none is."""
        if self.verdict not in ("effect", "ambiguous") or not self.named:
            return ""
        return max(self.named, key=lambda name: self.probabilities.get(name, 0.0))

    @property
    def pointed(self) -> dict[str, float]:
        """Probabilities without what every candidate has alike."""
        even = min(self.probabilities.values(), default=0.0)
        return {name: p - even for name, p in self.probabilities.items()}


class Outcome(_Table):
    """One recording: a verdict, or why there is none; how long it took, and what of that its process computed [s].

    ``program`` is the hash of the source that said it; earlier ones do not know.
    """

    file: str
    sha256: str
    seconds: float
    cpu_seconds: float | None = None
    verdict: Verdict | None = None
    failure: str = ""
    program: str = ""

    @property
    def answer(self) -> str:
        """The verdict's word, or that there is none."""
        return self.verdict.verdict if self.verdict is not None else FAILED


class Withheld(_Table):
    """One recording diagnosed again without single candidates: outcomes by the name of the one withheld.

    Candidates that the diagnosis had given no chance are not in it: its verdict stands without them.
    """

    file: str
    outcomes: dict[str, Outcome]


class Run(_Table):
    """How a run was made; a run that goes on must be the same.

    ``library`` are the candidates that were at hand, ``without`` those that were withheld from all recordings, and
    ``program`` is the sha256 of the diagnosis' own source.
    """

    system_name: str
    system_hash: str
    answers_sha256: str
    library: list[str]
    without: list[str] = []
    settings: dict[str, Any] = {}
    version: str = ""
    program: str = ""


def name_of(file: str) -> str:
    """File name of the verdict on a recording."""
    return f"{Path(file).stem}.json"


def write_run(results: Path, run: Run) -> None:
    """Write how a run is made."""
    results.mkdir(parents=True, exist_ok=True)
    _write(results / RUN, run)


def read_run(results: Path | str) -> Run:
    """Read how a run was made.

    Raises
    ------
    RecordingError
        If it is missing or not one.
    """
    return Run.model_validate(_read(Path(results) / RUN, Run))


def write_outcome(results: Path, outcome: Outcome) -> None:
    """Write one verdict, whole or not at all."""
    (results / VERDICTS).mkdir(parents=True, exist_ok=True)
    _write(results / VERDICTS / name_of(outcome.file), outcome)


def read_outcome(results: Path | str, file: str) -> Outcome:
    """Read the verdict on a recording.

    Raises
    ------
    RecordingError
        If it is missing or not one.
    """
    return Outcome.model_validate(_read(Path(results) / VERDICTS / name_of(file), Outcome))


def check_program(results: Path | str, outcome: Outcome, run: Run) -> None:
    """Refuse a verdict of another program than the run's: source that was changed, and changed back, while it ran.

    Raises
    ------
    RecordingError
        If it is.
    """
    if outcome.program not in ("", run.program):
        where = Path(results) / VERDICTS / name_of(outcome.file)
        raise RecordingError(
            f"{where}: program is {outcome.program[:12]}, the run's {run.program[:12]}; expected verdicts of one"
            " program: remove what the other one said and run again"
        )


def write_withheld(results: Path, withheld: Withheld) -> None:
    """Write the verdicts of one recording with candidates withheld."""
    (results / WITHOUT).mkdir(parents=True, exist_ok=True)
    _write(results / WITHOUT / name_of(withheld.file), withheld)


def read_withheld(results: Path | str, file: str) -> Withheld | None:
    """Read them; None where they were not asked for."""
    path = Path(results) / WITHOUT / name_of(file)
    return Withheld.model_validate(_read(path, Withheld)) if path.exists() else None


def digest(results: Path | str, files: list[str]) -> str:
    """Hash of all verdicts in order: to be published before the answers are opened, it fixes what was said."""
    whole = hashlib.sha256()
    for file in files:
        for folder in (VERDICTS, WITHOUT):
            path = Path(results) / folder / name_of(file)
            whole.update(f"{folder}/{name_of(file)}\n".encode() + (path.read_bytes() if path.exists() else b""))
    return whole.hexdigest()


def _write(path: Path, what: BaseModel) -> None:
    text = json.dumps({"schema": SCHEMA, **what.model_dump(mode="json")}, indent=1, allow_nan=False)
    write_atomically(path, (text + "\n").encode())


def _read(path: Path, kind: type[BaseModel]) -> dict[str, Any]:
    """The content of a file of this schema, held against its kind."""
    expected = f"a file of `diagnosis blind run` ({kind.__name__.lower()})"
    raw = read_json(path, RecordingError, expected)
    if not isinstance(raw, dict) or raw.pop("schema", None) != SCHEMA:
        raise RecordingError(f"{path}: schema is not {SCHEMA!r}; expected {expected}")
    validated(kind, raw, f"{path}", RecordingError, expected)
    return raw
