"""The files that a simulation needs beside Python code: the FMU and the user's own weather files.

A worker uses them where the client does, if it sees the same files there. If not, it asks for them once, and keeps
them in a folder that is named by their content.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from datagen.driving.weather import weather_path
from datagen.fmi.fmu import fmu_sha256
from shared.errors import WeatherError
from shared.places import own_folder
from shared.store import sha256_of, write_atomically
from shared.system import System, system_from_canonical

_SHIPPED = "pvlib:"


def weather_files(system: System) -> list[str]:
    """The description's own weather files; those that pvlib ships are on every worker."""
    return [one for one in (system.weather.files if system.weather else []) if not one.startswith(_SHIPPED)]


def weather_hashes(system: System) -> dict[str, str]:
    """sha256 of every weather file of a description: its content counts. A WeatherError if one cannot be read."""
    found = {}
    for file in system.weather.files if system.weather else []:
        path = weather_path(file, system.path.parent)
        try:
            found[file] = sha256_of(path)
        except OSError as error:
            raise WeatherError(f"{path}: cannot be read: {error.strerror}; expected a weather file") from None
    return found


def package_hash(fmu_hash: str, weather: dict[str, str]) -> str:
    """Name of a package: sha256 over the contents of its files."""
    lines = [f"fmu {fmu_hash}", *(f"{name} {digest}" for name, digest in sorted(weather.items()))]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def package_files(system: System) -> dict[str, bytes]:
    """Contents by the names they get on a worker."""
    files = {kept: weather_path(file, system.path.parent).read_bytes() for file, kept in _kept_as(system).items()}
    return {"model.fmu": system.fmu_path.read_bytes(), **files}


def _kept_as(system: System) -> dict[str, str]:
    """Names that a description's own weather files get on a worker."""
    return {file: f"weather-{k}{Path(file).suffix}" for k, file in enumerate(weather_files(system))}


def receive(package: str, files: dict[str, bytes]) -> None:
    """On a worker: keep a package. What lies there already is written over, file by file."""
    folder = own_folder(package)
    for name, content in files.items():
        write_atomically(folder / name, content)


def locate(canonical: str, system_path: str, package: str) -> System | None:
    """The system with paths that hold on this machine, or None if the package is not here and must be sent."""
    system = system_from_canonical(canonical, Path(system_path))
    if not package or _is(system, package):
        return system
    folder = own_folder(package)
    names = {file: str(folder / kept) for file, kept in _kept_as(system).items()}
    changes: dict[str, object] = {"fmu": str(folder / "model.fmu")}
    if system.weather is not None:
        files = [names.get(file, file) for file in system.weather.files]
        changes["weather"] = system.weather.model_copy(update={"files": files})
    here = system.model_copy(update=changes)
    return here if _is(here, package, names) else None


def _is(system: System, package: str, names: dict[str, str] | None = None) -> bool:
    """Whether the files behind a description are those of the package; ``names`` maps described to local ones."""
    back = {local: file for file, local in (names or {}).items()}
    try:
        digests = {back.get(file, file): digest for file, digest in weather_hashes(system).items()}
        return package_hash(fmu_sha256(system.fmu_path), digests) == package
    except Exception:
        return False


def sees_folder(folder: str, token: str) -> bool:
    """Whether this process sees the very dataset folder that a run with this token writes to."""
    from shared.lock import read_holder

    return bool(token) and read_holder(folder).get("token") == token
