"""Diagnose every recording of a blind set: the recordings and their manifest are all that is read.

Every recording is diagnosed in a process of its own, so that one that crashes or hangs is one failure and no more.
A verdict is written whole as soon as it is reached; the same call goes on from what is there.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

from datagen.fmi.fmu import fmu_sha256
from diagnosis.blind.begun import uncertain_sha256
from diagnosis.blind.judging import Diagnoser, Judge, program
from diagnosis.blind.sealed import read_manifest
from diagnosis.blind.verdicts import (
    LIMIT,
    RUN,
    VERDICTS,
    WITHOUT,
    Parameter,
    Run,
    check_program,
    name_of,
    read_outcome,
    read_run,
    write_run,
)
from diagnosis.blind.working import CHANCE, Job, lost, work
from diagnosis.effects import library
from diagnosis.zero_shot import check_estimator
from shared import __version__
from shared.children import starting
from shared.errors import RecordingError, SystemDescriptionError
from shared.logs import fields, log_files, logger
from shared.shipped import estimator_beside, resolved_estimator
from shared.store import sha256_of
from shared.system import System, load_system

_log = logger(__name__)
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

Progress = Callable[[int, int], object]


def run(
    system: System | Path | str,
    folder: Path | str,
    out: Path | str,
    *,
    workers: int = 1,
    without: Sequence[str] = (),
    leave_one_out: bool = False,
    estimator: Path | str | None = None,
    seed: int = 0,
    limit: float = LIMIT,
    judge: Judge | None = None,
    progress: Progress | None = None,
) -> Run:
    """Diagnose the recordings of a blind set and write one verdict file each; what is there is not done again.

    Parameters
    ----------
    folder
        What ``blind make`` published.
    out
        Folder for ``run.json`` and the verdicts.
    workers
        Recordings that are diagnosed side by side, each in a process of its own. 0: one after another in this process.
    without
        Candidates that are withheld from the library for all recordings.
    leave_one_out
        Diagnose each recording again without each candidate that had a chance in its first verdict
        (:data:`diagnosis.blind.working.CHANCE`); the score uses the verdicts without the one that is true.
    estimator
        Folder of an estimator, or the name of a system that comes with one: its estimate is each diagnosis' first
        start.
    seed
        Of the diagnoses' own random numbers.
    limit
        A recording that takes longer, with all that is withheld from it, is stopped: what was not reached counts as a
        failure [s].
    judge
        Another than this package's diagnosis.
    progress
        Is told how many of how many are done.

    Raises
    ------
    RecordingError
        If the set is not of this system, a recording has changed, the folder holds another run, or no time is given.
    SystemDescriptionError
        If a withheld candidate is not in the library.
    EstimatorError
        If there is no estimator, or it is of other parameters than the system's.
    """
    if not limit > 0:
        raise RecordingError(f"limit is {limit:g} s; expected more than 0")
    described = system if isinstance(system, System) else load_system(system)
    folder, results = Path(folder), Path(out)
    manifest = read_manifest(folder)
    _check(described, folder, manifest)
    names = [one.name for one in library(described)]
    for name in set(without) - set(names):
        raise SystemDescriptionError(
            f"{described.path}: {name!r} is withheld but no effect; found {', '.join(names) or 'none'}"
        )
    if estimator is not None:
        check_estimator(estimator, described)
    asked = Run(
        system_name=described.name,
        system_hash=described.hash(),
        answers_sha256=manifest["answers_sha256"],
        library=[name for name in names if name not in without],
        without=sorted(without),
        parameters=[
            Parameter(name=one.name, unit=one.unit, min=one.min, max=one.max, scale=one.scale)
            for one in described.parameters
        ],
        settings={
            "estimator": None if estimator is None else str(estimator),
            "seed": seed,
            "limit": float(limit),
            "chance": CHANCE,
            "declared": _hash(described),
            "estimator_files": _files(estimator if estimator is not None else estimator_beside(described.path)),
        },
        version=__version__,
        program=program(),
    )
    _begin(results, asked)
    chosen = judge or Diagnoser(described, tuple(without), None if estimator is None else Path(estimator), seed)
    listed = manifest["recordings"]
    jobs = [
        Job(chosen, folder, results, one, leave_one_out)
        for one in listed
        if not (results / VERDICTS / name_of(one["file"])).exists()
        or (leave_one_out and not (results / WITHOUT / name_of(one["file"])).exists())
    ]
    tell = _counter(len(listed) - len(jobs), len(listed), progress)
    if workers < 1:
        for job in jobs:
            work(job)
            tell()
    else:
        _side_by_side(jobs, workers, limit, tell)
    if program() != asked.program:
        raise RecordingError(f"{results}: the program's source changed while it ran; expected verdicts of one program")
    for one in listed:
        check_program(results, read_outcome(results, one["file"]), asked)
    return asked


def _side_by_side(jobs: Sequence[Job], workers: int, limit: float, tell: Callable[[], None]) -> None:
    """Each job in a process of its own, so many at a time."""
    for name in _ONE_THREAD:  # processes are what runs side by side
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")  # loading an FMU changes the folder of its process
    waiting, running = list(jobs), dict[int, tuple[SpawnProcess, Job, float]]()
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                job = waiting.pop(0)
                process = context.Process(target=_alone, args=(job,))
                with starting():  # one that dies of Ctrl-C would count as a recording that failed
                    process.start()
                running[process.sentinel] = (process, job, time.perf_counter())
            wait(list(running), timeout=1.0)
            for sentinel, (process, job, began) in list(running.items()):
                took = time.perf_counter() - began
                if process.is_alive() and took <= limit:
                    continue
                if process.is_alive():
                    _end(process)
                    lost(job, took, f"took longer than {limit:g} s and was stopped")
                else:
                    process.join()
                    lost(job, took, f"its process ended with code {process.exitcode}")
                _log.debug("%s", job.listed["file"], extra=fields(seconds=took, code=process.exitcode))
                del running[sentinel]
                tell()
    finally:
        for process, _, _ in running.values():
            _end(process)


def _alone(job: Job) -> None:
    """Work that ends when the process that wanted it does, however that ended."""

    def watch() -> None:
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    work(job)


def _end(process: SpawnProcess) -> None:
    process.terminate()
    process.join(5.0)
    if process.is_alive():
        process.kill()
        process.join()


def _begin(results: Path, asked: Run) -> None:
    """Note how this run is made, or hold it against how it was begun."""
    if not (results / RUN).exists():
        if results.exists() and any(path.resolve() not in log_files() for path in results.iterdir()):
            raise RecordingError(f"{results}: is not empty and holds no run; expected a new folder or a run's")
        write_run(results, asked)
        return
    begun = read_run(results)
    for field in Run.model_fields:
        was, now = getattr(begun, field), getattr(asked, field)
        if field == "settings":
            was, now = _apart(was, now)
        if was != now:
            raise RecordingError(f"{results / RUN}: {field} was {was!r}; expected {now!r}, or a new folder")


def _apart(was: dict[str, Any], now: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The settings that differ; runs of programs that did not note the limit go on with any."""
    names = [name for name in {**was, **now} if name in was or name != "limit"]
    names = [name for name in names if (name in was, was.get(name)) != (name in now, now.get(name))]
    return {name: was[name] for name in names if name in was}, {name: now[name] for name in names if name in now}


def _hash(system: System) -> str:
    """The sha256 of all that is declared for a diagnosis and is no part of the system's own hash."""
    tables = (system.effects, system.uncertain, system.sources, system.outputs)
    declared = [[one.model_dump(mode="json") for one in table] for table in tables]
    return hashlib.sha256(json.dumps(declared, sort_keys=True).encode()).hexdigest()


def _files(folder: Path | str | None) -> str | None:
    """The sha256 of the files of an estimator, given as it may be loaded; None without one."""
    if folder is None:
        return None
    files = sorted(path for path in resolved_estimator(folder).rglob("*") if path.is_file())
    return hashlib.sha256("".join(sha256_of(path) for path in files).encode()).hexdigest()


def _check(system: System, folder: Path, manifest: dict[str, Any]) -> None:
    """A set of this system, as it was published."""
    if manifest["system_hash"] != system.hash():
        raise RecordingError(
            f"{folder}: system_hash is {manifest['system_hash']}; expected {system.hash()}, that of {system.path}"
        )
    if manifest["fmu_sha256"] != fmu_sha256(system.fmu_path):
        raise RecordingError(f"{folder}: fmu_sha256 is not that of {system.fmu_path}; expected the same FMU")
    if manifest.get("uncertain_sha256") not in (None, uncertain_sha256(system)):  # older sets do not say
        raise RecordingError(
            f"{folder}: uncertain_sha256 is not that of {system.path}; expected the same [[uncertain]]"
        )
    for one in manifest["recordings"]:
        path = folder / one["file"]
        if not path.exists() or sha256_of(path) != one["sha256"]:
            raise RecordingError(f"{path}: missing or changed since it was published")


def _counter(done: int, total: int, progress: Progress | None) -> Callable[[], None]:
    count = done
    if progress is not None:
        progress(count, total)

    def tell() -> None:
        nonlocal count
        count += 1
        if progress is not None:
            progress(count, total)

    return tell
