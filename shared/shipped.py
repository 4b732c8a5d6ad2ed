"""What comes with the package: systems and their pretrained estimators, by name instead of by path."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

DESCRIPTION = "system.toml"
USUAL = "MixedAirCO2"
"""The system that is meant where none is named: the paper's."""
CARD = "estimator.json"
ESTIMATOR = "estimator"
"""Folder of a shipped system that holds its pretrained estimator."""


def shipped_systems() -> dict[str, Path]:
    """Folders of the systems that come with the package, by name."""
    found = find_spec("fmus")
    folders = [Path(place) for place in (found.submodule_search_locations or [])] if found is not None else []
    return {path.parent.name: path.parent for folder in folders for path in sorted(folder.glob(f"*/{DESCRIPTION}"))}


def resolved(path: Path | str) -> Path:
    """A path as it is; or, where nothing lies there and it is the name of a shipped system, that system's folder."""
    path = Path(path)
    if path.exists() or len(path.parts) != 1:
        return path
    return shipped_systems().get(path.name, path)


def resolved_estimator(path: Path | str) -> Path:
    """The estimator that a path leads to: itself, as a rule.

    Of a system, which all other commands take by its folder or its description, the one in ``estimator`` beside the
    description; where nothing lies there and it names a shipped system, that system's.
    """
    path = Path(path)
    if not path.exists():
        return shipped_estimator(path) or path
    if path.is_dir() and not (path / CARD).exists():
        return estimator_beside(path / DESCRIPTION) or path
    return (estimator_beside(path) or path) if path.suffix == ".toml" else path


def shipped_estimator(name: Path) -> Path | None:
    """The estimator of the shipped system of this name, if there is one."""
    folder = shipped_systems().get(name.name) if len(name.parts) == 1 else None
    return None if folder is None else folder / ESTIMATOR


def estimators() -> str:
    """Names of the shipped systems that come with an estimator, in words."""
    return ", ".join(name for name, folder in shipped_systems().items() if (folder / ESTIMATOR).is_dir()) or "none"


def estimator_beside(description: Path) -> Path | None:
    """The estimator in a folder ``estimator`` beside a system description (TOML), if there is one."""
    folder = description.parent / ESTIMATOR
    return folder if (folder / CARD).is_file() else None
