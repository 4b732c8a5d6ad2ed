"""The seal: answers lie in a file of their own, and only its hash is published with the recordings."""

from __future__ import annotations

import hashlib
import json
import shlex
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from diagnosis.blind.truth import default_truth
from diagnosis.blind.verdicts import LIMIT, Run
from shared.errors import RecordingError
from shared.reading import read_json, validated
from shared.shipped import DESCRIPTION, shipped_systems
from shared.store import sha256_of, write_atomically
from shared.system import System, load_system


def source_sha256(*packages: str, counts: Callable[[str], bool] = lambda _: True) -> str:
    """The sha256 of all modules of packages, with their names; packages that are not installed have none.

    Parameters
    ----------
    counts
        Whether a module counts, by its path that begins with the package, with slashes.
    """
    whole = hashlib.sha256()
    for package in packages:
        found = find_spec(package)
        if found is None or found.origin is None:
            continue
        root = Path(found.origin).parent
        for path in sorted(root.rglob("*.py")):
            name = f"{package}/{path.relative_to(root).as_posix()}"
            if counts(name):
                whole.update(f"{name}\n".encode() + path.read_bytes())
    return whole.hexdigest()


SCHEMA = "blind-1"
MANIFEST = "manifest.json"


Series = dict[str, list[Annotated[float, Field(allow_inf_nan=False)]]]


class _Open(BaseModel):
    """What readers rely on; the rest is kept as it is."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    file: str = Field(pattern=r"^[\w-]+/[\w.-]+$", description="below the set's folder")
    replay: bool


class _Published(_Open):
    sha256: str


class _Cause(BaseModel):
    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    amplitude: float
    scale: float = Field(gt=0)


class _Lengths(BaseModel):
    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    length: float = Field(ge=0)


class _Answer(_Open):
    stratum: str
    verdict: str
    effects: list[str]
    causes: list[_Cause]
    start: float
    parameters: dict[str, float]
    constants: dict[str, Annotated[float, Field(gt=0)]] = {}
    gap_over_noise: dict[str, float]
    clean: Series
    base: Series
    detectability: _Lengths | None = None


class _Set(BaseModel):
    model_config = ConfigDict(extra="allow", allow_inf_nan=False)
    system_name: str
    system_hash: str
    fmu_sha256: str
    uncertain_sha256: str | None = None
    step: float = Field(gt=0)
    hours: float = Field(gt=0)


class _Manifest(_Set):
    answers_sha256: str
    recordings: list[_Published]


class _Answers(_Set):
    seed: int
    recordings: list[_Answer]


def seal(path: Path, answers: dict[str, Any]) -> str:
    """Write the answers and return their sha256. ``answers`` has a salt, so that nobody can guess their content.

    Raises
    ------
    RecordingError
        If there are others.
    """
    content = (json.dumps({"schema": SCHEMA, **answers}, separators=(",", ":")) + "\n").encode()
    digest = hashlib.sha256(content).hexdigest()
    if not path.exists():
        write_atomically(path, content)
    elif not path.is_file() or sha256_of(path) != digest:  # the same are those of a call that was stopped
        raise RecordingError(f"{path}: exists; expected a new file for the answers")
    return digest


def salt_of(seed: int) -> str:
    """The salt of a set: a hash that only the seed gives, so that a set can be made again byte by byte."""
    return hashlib.sha256(f"blind salt {seed}".encode()).hexdigest()


def publish(folder: Path, manifest: dict[str, Any]) -> None:
    """Write the manifest of the recordings."""
    write_atomically(folder / MANIFEST, (json.dumps({"schema": SCHEMA, **manifest}, indent=1) + "\n").encode())


def read_manifest(folder: Path | str) -> dict[str, Any]:
    """The manifest of a blind set.

    Raises
    ------
    RecordingError
        If it is missing or of another schema.
    """
    return _read(Path(folder) / MANIFEST, "a manifest made by `diagnosis blind make`", _Manifest)


def open_answers(folder: Path | str, answers: Path | str) -> dict[str, Any]:
    """Open the sealed answers of a blind set: only those whose hash was published, for recordings as published.

    Raises
    ------
    RecordingError
        If a file is missing, the answers are not those that were sealed, or a recording has changed.
    """
    folder, answers = Path(folder), Path(answers)
    manifest = read_manifest(folder)
    opened = _read(answers, "answers made by `diagnosis blind make`", _Answers)
    if sha256_of(answers) != manifest["answers_sha256"]:
        raise RecordingError(
            f"{answers}: sha256 is {sha256_of(answers)}; expected {manifest['answers_sha256']}, as published"
        )
    for one in manifest["recordings"]:
        path = folder / one["file"]
        if not path.exists() or sha256_of(path) != one["sha256"]:
            raise RecordingError(f"{path}: missing or changed since it was published")
    return opened


def _read(path: Path, what: str, kind: type[BaseModel]) -> dict[str, Any]:
    raw = read_json(path, RecordingError, what)
    if not isinstance(raw, dict) or raw.get("schema") != SCHEMA:
        raise RecordingError(f"{path}: schema is not {SCHEMA!r}; expected {what}")
    return validated(kind, raw, f"{path}", RecordingError, what).model_dump(exclude_unset=True)


def made_of(system: System, truth: Path) -> dict[str, str]:
    """The files that a set is made of, to be sealed with its answers.

    ``system`` is the name of one that comes with the package, or else its file's; ``truth`` the file's name, empty
    where it is the one that is taken if none is given.
    """
    name, same = system.path.name, system
    for shipped, folder in shipped_systems().items():
        if (one := load_system(folder / DESCRIPTION)).canonical() == system.canonical():
            name, same = shipped, one
    digest, usual = sha256_of(truth), default_truth(same)
    is_usual = usual.is_file() and sha256_of(usual) == digest
    return {"system": name, "truth": "" if is_usual else truth.name, "truth_sha256": digest}


def commands(
    opened: dict[str, Any],
    run: Run,
    folder: Path,
    answers: Path,
    results: Path,
    scored: Sequence[object],
    *,
    leave_one_out: bool,
) -> list[str]:
    """The three commands; leave-one-out only where all had it. Of each path the last part, wherever it was.

    ``scored``: what the last one has after its places.
    """
    planned, system = len(opened["recordings"]), _system(opened)
    make = ["make", folder, "--system", system, "--recordings", planned, "--seed", opened["seed"]]
    make += ["--hours", f"{opened['hours']:g}"]
    make += ["--truth", opened["truth"]] if opened.get("truth") else []
    make += ["--answers", answers] if answers.name != f"{folder.absolute().name}.answers.json" else []
    made = ["run", system, folder, "--out", results, "--seed", run.settings.get("seed", 0)]
    made += ["--run", run.settings["estimator"]] if run.settings.get("estimator") else []
    made += ["--without", *run.without] if run.without else []
    limit = run.settings.get("limit", LIMIT)
    made += ["--limit", f"{limit:g}"] if limit != LIMIT else []
    made += ["--leave-one-out"] if leave_one_out else []
    score = ["score", folder, answers, results, *scored]
    return [shlex.join(["diagnosis", "blind", *map(_short, one)]) for one in (make, made, score)]


def _system(opened: dict[str, Any]) -> str:
    """What was sealed; of earlier sets, which say no more than what the system calls itself, the most likely."""
    name = str(opened["system_name"])
    return str(opened.get("system", name if name in shipped_systems() else f"{name}/{DESCRIPTION}"))


def _short(word: object) -> str:
    return word.absolute().name if isinstance(word, Path) else str(word)
