"""Recordings whose cause is known, made and diagnosed on Dask workers: what a system's verdict is calibrated by."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import pandas as pd

from datagen.farming.cluster import connect
from datagen.fmi.fmu import fmu_sha256
from diagnosis.blind.generator import Generator
from diagnosis.blind.make import uncertain_sha256
from diagnosis.effects import library
from diagnosis.farming.calibration import calibrated
from diagnosis.farming.rows import Row, Rows, generator, read_row, work
from diagnosis.gap.verdict import decide
from diagnosis.recording import DAY, HOUR
from diagnosis.verdicts import FILE_NAME, Verdicts, candidates_sha256
from shared import __version__
from shared.errors import RecordingError
from shared.lock import FolderLock
from shared.logs import logger
from shared.numbers import counted
from shared.reading import read_json
from shared.results import Result
from shared.store import write_atomically
from shared.system import System, load_system, system_from_canonical

ROWS = "rows"
ABOUT = "about.json"
HOURS = 168.0
_log = logger(__name__)
Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Farmed(Result):
    """What a farm made: its rows, the verdict that they calibrate, or why there is none, and why recordings failed."""

    made: Rows
    verdicts: Verdicts | None
    lacking: str
    failed: dict[int, str]

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        told = self.lacking if self.verdicts is None else f"verdict of {self.verdicts.made}"
        return f"{counted(len(self.made.rows), 'recording')} of {self.made.about['system']}: {told}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each recording: what it was, and what was answered."""
        columns = ["recording", "stratum", "true", "gap", "named", "verdict", "cpu_seconds"]
        rows = [
            {
                "recording": row.index,
                "stratum": row.stratum,
                "true": ", ".join(row.true),
                "gap": row.gap,
                "named": ", ".join(row.evidence.chosen if done is None else done.named),
                "verdict": None if done is None else done.verdict,
                "cpu_seconds": row.cpu_seconds,
            }
            for row in self.made.rows
            for done in [None if self.verdicts is None else decide(row.evidence, self.verdicts)]
        ]
        return pd.DataFrame(rows, columns=columns).set_index("recording")


def farm(
    system: System | Path | str,
    out: Path | str,
    *,
    recordings: int = 400,
    seed: int | None = None,
    hours: float = HOURS,
    noise: str = "sensor",
    workers: int | None = 1,
    scheduler: str | None = None,
    progress: Progress = lambda done, recordings: None,
) -> Farmed:
    """Make recordings of a system whose cause is known, diagnose each, and calibrate the system's verdict by them.

    ``verdict.json`` in the folder is what ``diagnosis run`` reads where it lies beside the system's description.

    A recording depends on the seed and its number alone: more may be asked for later, what is there is not made again,
    and one that failed is tried again by the same call.

    Parameters
    ----------
    out
        Folder of the rows.
    seed
        Decides all; drawn if not given, and that of the folder if there is one.
    hours
        Length of each recording [h], at least a day.
    noise
        A noise preset of the description.
    workers, scheduler
        Processes on this machine, or the address of a Dask scheduler, whose workers have the FMU under the same path.

    Raises
    ------
    RecordingError
        If the folder holds rows of another system, version, seed or length, or the recordings would be too short.
    SystemDescriptionError, FmuError, ClusterError
        If the system or the workers cannot be used.
    """
    described = system if isinstance(system, System) else load_system(system)
    if recordings < 1:
        raise RecordingError(f"recordings is {recordings}; expected at least 1, for example 400")
    if hours * HOUR < DAY:
        raise RecordingError(f"hours is {hours:g}; expected at least 24: a diagnosis reads no shorter recording")
    if noise not in described.noise_presets:
        presets = ", ".join(described.noise_presets)
        raise RecordingError(f"noise is {noise!r}; expected a preset of {described.path}: {presets or 'it has none'}")
    generator(described, hours, noise)  # what cannot be used is refused before anything is begun
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    with FolderLock(folder, str(described.path.resolve()), kind=RecordingError):
        about = _begun(folder, described, seed, hours, noise)
        (folder / ROWS).mkdir(exist_ok=True)
        _rows(folder)  # what cannot be read is refused before hours go into more of them
        left = [index for index in range(recordings) if not _path(folder, index).exists()]
        done, failed = recordings - len(left), {}
        progress(done, recordings)
        with connect(workers=workers, scheduler=scheduler) if left else nullcontext() as client:
            if client is not None:
                what = (described.canonical(), str(described.path), hours, noise, about["seed"])
                for index, made in _worked_off(client, what, left):
                    if isinstance(made, str):
                        failed[index] = made
                        _log.warning("recording %d failed: %s", index, made)
                    else:
                        write_atomically(_path(folder, index), json.dumps(made, allow_nan=False).encode())
                    done += 1
                    progress(done, recordings)
        found = Rows(about, _rows(folder))
        try:
            verdicts, lacking = calibrated(found), ""
        except RecordingError as error:
            return Farmed(found, None, str(error), failed)
        write_atomically(folder / FILE_NAME, verdicts.model_dump_json(indent=1).encode() + b"\n")
    return Farmed(found, verdicts, lacking, failed)


def _worked_off(client: Any, what: tuple[Any, ...], left: list[int]) -> Iterator[tuple[int, dict[str, Any] | str]]:
    """Numbers and their rows as they are made, or why there is none; few wait at the workers at a time."""
    executor = client.get_executor(pure=False)
    ahead = 2 * max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
    waiting = iter(left)
    running: dict[Future[Any], int] = {}
    while True:
        for index in islice(waiting, ahead - len(running)):
            running[executor.submit(_row, what, index)] = index
        if not running:
            return
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            try:
                made = future.result()
            except (Exception, CancelledError) as error:  # its worker is gone, or was told to stop
                made = f"{type(error).__name__}: {error}"
            yield running.pop(future), made


def _row(what: tuple[str, str, float, str, int], index: int) -> dict[str, Any] | str:
    """A row, made on a worker, or why there is none: whatever goes wrong with one recording, the others are made."""
    canonical, path, hours, noise, seed = what
    try:
        made = work(_generator(canonical, path, hours, noise), seed, index)
        json.dumps(made, allow_nan=False)
        return made
    except Exception as error:
        return f"{type(error).__name__}: {error}"


@lru_cache(maxsize=1)
def _generator(canonical: str, path: str, hours: float, noise: str) -> Generator:
    return generator(system_from_canonical(canonical, Path(path)), hours, noise)


def _begun(folder: Path, system: System, seed: int | None, hours: float, noise: str) -> dict[str, Any]:
    """What the rows of a folder are of: noted, or held against what was noted before."""
    about = {
        "system": system.name,
        "system_hash": system.hash(),
        "fmu_sha256": fmu_sha256(system.fmu_path),
        "uncertain_sha256": uncertain_sha256(system),
        "candidates_sha256": candidates_sha256(library(system)),
        "version": __version__,
        "hours": hours,
        "noise": noise,
    }
    path = folder / ABOUT
    if path.exists():
        begun = read_json(path, RecordingError, "what a farm's rows are of")
        asked = about | {"seed": begun.get("seed") if seed is None else seed}
        for name, value in asked.items():
            if begun.get(name) != value:
                raise RecordingError(
                    f"{path}: {name} is {begun.get(name)!r}; expected {value!r}: rows of two kinds are not mixed. Give"
                    " another --out, or what the folder was begun with"
                )
        return dict(begun)
    if (folder / ROWS).exists() and any((folder / ROWS).iterdir()):
        raise RecordingError(f"{folder}: has rows and no {ABOUT}; expected both, or an empty folder")
    about["seed"] = secrets.randbelow(2**31) if seed is None else seed
    write_atomically(path, json.dumps(about, indent=1).encode())
    return about


def _rows(folder: Path) -> tuple[Row, ...]:
    """The rows of a folder in the order of their numbers."""
    paths = (folder / ROWS).glob("*.json")
    rows = [read_row(read_json(path, RecordingError, "a row of a farm")) for path in paths]
    return tuple(sorted(rows, key=lambda one: one.index))


def _path(folder: Path, index: int) -> Path:
    return folder / ROWS / f"{index}.json"
