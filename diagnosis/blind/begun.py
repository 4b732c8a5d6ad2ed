"""A blind set that is being made: what decides its content, so that it goes on only as it was begun."""

from __future__ import annotations

import hashlib
import json
import secrets
from pathlib import Path
from typing import Any

from diagnosis.blind.source import source_sha256
from shared.errors import RecordingError
from shared.reading import read_json
from shared.store import write_atomically
from shared.system import System


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
