"""A blind set that is being made: where it may be, and what decides its content, so that it goes on as it was begun."""

from __future__ import annotations

import hashlib
import json
import secrets
from pathlib import Path
from typing import Any

from diagnosis.blind.sealed import MANIFEST, read_manifest
from diagnosis.blind.source import source_sha256
from shared.errors import RecordingError
from shared.logs import log_files
from shared.places import check_folder
from shared.reading import read_json
from shared.store import sha256_of, write_atomically
from shared.system import System


def check_new(folder: Path, sealed: Path, copied: dict[str, Path]) -> None:
    """Refuse a place where something is already, unless it is the very set that is about to be finished.

    Parameters
    ----------
    folder, sealed
        What is published, and the file of its answers.
    copied
        Recordings by their name in ``folder``, and where each lies until all are made, with its answer beside it.

    Raises
    ------
    RecordingError
        If something is there, one of the two lies in the other, or nothing can be written there.
    """
    all_made = all(path.with_suffix(".json").exists() for path in copied.values())
    for log in log_files():  # its first line is the command, seed and all
        if folder.resolve() in log.parents:
            raise RecordingError(f"{log}: lies in {folder}, which is published; expected another place for the log")
    check_folder(folder, RecordingError)
    stopped = all_made and sealed.is_file() and _holds_no_other(folder, sealed, copied)
    if folder.exists() and any(folder.iterdir()) and not stopped:
        what = "holds a blind set" if _is_set(folder) else "is not empty"
        raise RecordingError(f"{folder}: {what}; expected a new folder")
    if sealed.exists() and not all_made:
        raise RecordingError(f"{sealed}: exists; expected a new file for the answers")
    if folder.resolve() in sealed.resolve().parents:
        raise RecordingError(f"{sealed}: lies in {folder}, which is published; expected another place for the answers")
    check_folder(sealed.parent, RecordingError)


def _is_set(folder: Path) -> bool:
    try:
        return bool(read_manifest(folder))
    except RecordingError:
        return False


def _holds_no_other(folder: Path, sealed: Path, copied: dict[str, Path]) -> bool:
    """Whether all in a folder is what a call that was stopped had published of this set."""
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if path.is_dir() or (path.name.startswith(".") and path.name.endswith(".tmp")):  # half a file
            continue
        if name == MANIFEST:
            if not _is_set(folder) or read_manifest(folder)["answers_sha256"] != sha256_of(sealed):
                return False
        elif name not in copied or not copied[name].is_file() or sha256_of(path) != sha256_of(copied[name]):
            return False
    return True


def uncertain_sha256(system: System) -> str:
    """The sha256 of the uncertain constants: rooms differ in them, and the system's hash leaves them out."""
    declared = [one.model_dump(mode="json") for one in system.uncertain]
    return hashlib.sha256(json.dumps(declared, sort_keys=True).encode()).hexdigest()


def program_sha256() -> str:
    """The sha256 of all source that a recording depends on, so that those of two programs are not mixed."""
    return source_sha256("shared", "datagen", "diagnosis")


def begin(part: Path, about: dict[str, Any], seed: int | None) -> int:
    """The seed of a set that is begun, or of one that was begun before with the same settings."""
    path = part / "settings.json"
    if path.exists() and any(part.glob("[0-9]*.json")):  # where nothing was made, nothing was begun
        found = read_json(path, RecordingError, "settings of a set that is being made")
        before = found.pop("seed", None) if isinstance(found, dict) else None
        if not isinstance(before, int) or found != about or seed not in (None, before):
            raise RecordingError(f"{part}: was begun with other settings; expected the same, or remove it")
        return int(before)
    part.mkdir(parents=True, exist_ok=True)
    chosen = secrets.randbits(60) if seed is None else seed
    write_atomically(path, json.dumps({**about, "seed": chosen}).encode())
    return chosen
