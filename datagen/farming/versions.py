"""Versions of what decides a dataset's numbers, and what is said where several take part.

Equal versions give the same numbers, bit for bit. Others agree within the solver's tolerance, which a dataset may hold
side by side; but who reads it must be able to know.
"""

from __future__ import annotations

import platform
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path

from shared.logs import logger
from shared.manifest import Manifest

PACKAGE = "zeroshot-fmu"
DECIDING = (PACKAGE, "fmpy", "numpy", "pvlib", "numba")
"""Packages that a simulation's numbers come from, to the last bit."""
_ALL = (PACKAGE, "fmpy", "dask", "numpy", "scipy", "pandas", "netCDF4", "xarray", "pvlib", "numba")
_log = logger(__name__)


@cache
def _here() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: version(name) for name in _ALL}}


def all_here() -> dict[str, str]:
    """Versions of Python and of the packages that simulate and write, by name."""
    return dict(_here())


def deciding_here() -> dict[str, str]:
    """Versions here of :data:`DECIDING`, by name."""
    return {name: _here()[name] for name in DECIDING}


def difference(found: Mapping[str, str | None], expected: Mapping[str, str]) -> tuple[str, str] | None:
    """What of :data:`DECIDING` is of other versions: those found and those expected, in words; None where all agree."""
    other = [name for name in DECIDING if found.get(name) != expected.get(name)]
    return (_words(found, other), _words(expected, other)) if other else None


def _words(versions: Mapping[str, str | None], names: Iterable[str]) -> str:
    return ", ".join(f"{name} {versions[name]}" if versions.get(name) else f"no {name}" for name in names)


def note(manifest: Manifest, versions: dict[str, str], where: Path, whose: str) -> None:
    """Note in a manifest that ``versions`` take part in its numbers, with a warning if they are none of those noted.

    For the sentence: ``where`` is the dataset, and ``whose`` the versions are, ``this run`` or another dataset.
    """
    if not all(difference(one, versions) for one in manifest.all_versions()):
        return
    found, own = difference(manifest.versions, versions) or ("", "")
    manifest.other_versions = [*manifest.other_versions, versions]
    _log.warning(
        "%s: made with %s, %s with %s; their systems agree within the solver's tolerance, not bit for bit: manifest and"
        " card name all versions",
        *(where, found, whose, own),
    )


def in_words(manifest: Manifest) -> list[str]:
    """What of :data:`DECIDING` took part in a dataset's numbers, one line for each set of versions."""
    return [_words(one, DECIDING) for one in manifest.all_versions()]
