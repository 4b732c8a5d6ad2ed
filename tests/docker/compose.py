"""The compose files, read as Docker Compose would: variables put in, files on top of each other, images' defaults."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tests.docker.images import ROOT, Dockerfile, read

FOLDER = ROOT / "docker"
_VARIABLE = re.compile(r"\$\{(\w+):-([^}]*)\}")


def load(*names: str, variables: Mapping[str, str] | None = None) -> dict[str, Any]:
    """One or more files of docker/, each merged over those before it."""
    merged: dict[str, Any] = {}
    for name in names:
        text = (FOLDER / name).read_text()
        text = "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("#"))
        text = _VARIABLE.sub(lambda found: (variables or {}).get(found[1], found[2]), text)
        assert "$" not in text, f"{name}: a variable without a default"
        merged = _merge(merged, yaml.safe_load(text))
    return merged


def _merge(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        merged[key] = _merge(old, value) if isinstance(old, dict) and isinstance(value, dict) else value
    return merged


def image_of(service: Mapping[str, Any]) -> Dockerfile:
    """The Dockerfile that a service is built from."""
    build = service["build"]
    path = (FOLDER / build["context"] / build["dockerfile"]).resolve()
    assert path.is_file(), path
    return read(path)


def words_of(service: Mapping[str, Any]) -> list[str]:
    """What a service runs: its entry point and command, or those of its image."""
    final = image_of(service).final
    defaults = {kind: list(command.value) for kind in ("ENTRYPOINT", "CMD") if (command := final.last(kind))}
    return [*service.get("entrypoint", defaults["ENTRYPOINT"]), *service.get("command", defaults["CMD"])]


def image_file(name: str) -> Path:
    """Path of a Dockerfile of docker/."""
    return FOLDER / f"{name}.Dockerfile"
