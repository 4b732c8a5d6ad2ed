"""Diagnose every recording of a blind set: the recordings and their manifest are all that is read.

Every recording is diagnosed in a process of its own, so that one that crashes or hangs is one failure and no more.
A verdict is written whole as soon as it is reached; the same call goes on from what is there.

The diagnosis as the blind check asks it: a recording and its public conditions in, a verdict out.

The only module of the blind check that knows the diagnosis itself. It can be replaced by any other that judges.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from multiprocessing.connection import wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from datagen.fmi.fmu import fmu_sha256
from diagnosis.blind.make import uncertain_sha256
from diagnosis.blind.sealed import read_manifest, source_sha256
from diagnosis.blind.verdicts import (
    LIMIT,
    RUN,
    VERDICTS,
    WITHOUT,
    Moved,
    Outcome,
    Place,
    Run,
    Shrunk,
    Sized,
    Verdict,
    Withheld,
    check_program,
    name_of,
    read_outcome,
    read_run,
    write_outcome,
    write_run,
    write_withheld,
)
from diagnosis.effects import library
from diagnosis.zero_shot import check_estimator
from shared import __version__
from shared.children import starting
from shared.errors import RecordingError, SystemDescriptionError
from shared.logs import fields, log_files, logger
from shared.reading import read_json, validated
from shared.shipped import estimator_beside, resolved_estimator
from shared.store import sha256_of, write_atomically
from shared.system import System, load_system

if TYPE_CHECKING:
    from diagnosis.effects import Effect
    from diagnosis.gap.concluded import Diagnosis
    from diagnosis.gap.schema import Report

_log = logger(__name__)


class Judged(Protocol):
    """A recording that was judged, and can be judged again with less."""

    @property
    def verdict(self) -> Verdict:
        """With all candidates of the judge."""
        ...

    def without(self, name: str) -> Verdict:
        """With one candidate fewer."""
        ...


class Judge(Protocol):
    """What judges recordings. It must survive being pickled: every recording is judged in a process of its own."""

    def __call__(self, recording: Path, *, replay: bool, occupancy: str) -> Judged:
        """Judge one recording; the conditions are those that were published with it."""
        ...


@dataclass(frozen=True)
class Diagnoser:
    """Judges by :func:`diagnosis.gap.diagnosed.diagnose`.

    Parameters
    ----------
    without
        Candidates that are not to be considered at all.
    estimator
        Folder of an estimator, whose zero-shot estimate is the first start.
    seed
        Of twins, placebos and bootstraps.
    """

    system: System
    without: tuple[str, ...] = ()
    estimator: Path | None = None
    seed: int = 0

    def __call__(self, recording: Path, *, replay: bool, occupancy: str) -> Judged:
        """See :class:`Judge`."""
        return _Diagnosed(self, recording, replay, occupancy)

    def effects(self) -> list[Effect]:
        """The candidates that are left."""
        from diagnosis.effects import library

        return [one for one in library(self.system) if one.name not in self.without]


@dataclass(frozen=True)
class _Diagnosed:
    judge: Diagnoser
    recording: Path
    replay: bool
    occupancy: str

    @cached_property
    def done(self) -> Diagnosis:
        """The diagnosis with all candidates of the judge."""
        from diagnosis.gap.diagnosed import diagnose

        return diagnose(
            self.judge.system,
            self.recording,
            run=self.judge.estimator,
            replay=self.replay,
            occupancy=self.occupancy,
            effects=self.judge.effects(),
            seed=self.judge.seed,
        )

    @property
    def verdict(self) -> Verdict:
        return verdict_of(self.done.report)

    def without(self, name: str) -> Verdict:
        return verdict_of(self.done.without([name]).report)


def verdict_of(report: Report) -> Verdict:
    """What a score needs of ``report.json``."""
    probabilities = {one.name: one.probability for one in report.effects}
    return Verdict(
        verdict=report.verdict,
        probabilities=probabilities,
        none=report.none_of_these,
        nothing=report.no_gap,
        named=[one.name for one in report.effects if one.named],
        chosen=list(report.stages[-1].effects),
        sizes={
            one.name: Sized(low=one.low, high=one.high)
            for one in report.effects
            if one.named and one.low is not None and one.high is not None
        },
        where=[Place.model_validate(one, from_attributes=True) for one in report.where],
        shrinkage={one.channel: Shrunk(share=one.share) for one in report.shrinkage},
        parameters={one.name: Moved.model_validate(one, from_attributes=True) for one in report.parameters},
    )


def program() -> str:
    """The sha256 of all source that a verdict depends on, so that two programs' verdicts are not mixed.

    Of the blind check that is what makes a verdict of a report: this module, and what a verdict is.
    """
    own = {f"diagnosis/blind/{name}.py" for name in ("running", "verdicts")}
    return source_sha256(
        "shared",
        "datagen",
        "trainer",
        "diagnosis",
        counts=lambda path: path in own or not path.startswith("diagnosis/blind/"),
    )


CHANCE = 0.01
"""Leave-one-out withholds candidates that were named, fitted in the end or given this probability: without another one,
the verdict is taken to be the same."""


@dataclass(frozen=True)
class Job:
    """One recording, and what of it is still to be done."""

    judge: Judge
    folder: Path
    results: Path
    listed: dict[str, Any]
    leave_one_out: bool


def work(job: Job) -> None:
    """Diagnose one recording and write what was said; a diagnosis that fails is an outcome too."""
    file = job.listed["file"]
    path = job.folder / file
    judged = cache(lambda: job.judge(path, replay=job.listed["replay"], occupancy=job.listed["occupancy"]))
    if (job.results / VERDICTS / name_of(file)).exists():
        first = read_outcome(job.results, file)
    else:
        first = _outcome(job.listed, lambda: judged().verdict)
        write_outcome(job.results, first)
    if job.leave_one_out:
        _end_withheld(job, _left_out(job, judged, first))


def _left_out(job: Job, judged: Callable[[], Judged], first: Outcome) -> dict[str, Outcome]:
    """Outcomes without each candidate that had a chance; each is written when it is reached."""
    if first.verdict is None:
        return {}
    found = _reached(job)
    for name in contenders(first.verdict):
        if name not in found:
            found[name] = _outcome(job.listed, lambda name=name: judged().without(name))  # type: ignore[misc]
            _write_reached(job, found)
    return found


def _reached_at(job: Job) -> Path:
    return (job.results / WITHOUT / name_of(job.listed["file"])).with_suffix(".part")


def _reached(job: Job) -> dict[str, Outcome]:
    """Outcomes of a recording whose diagnosis was stopped; a ``RecordingError`` names a file that holds none."""
    path, expected = _reached_at(job), "what `diagnosis blind run` reached of a recording"
    if not path.exists():
        return {}
    return validated(Withheld, read_json(path, RecordingError, expected), f"{path}", RecordingError, expected).outcomes


def _write_reached(job: Job, outcomes: dict[str, Outcome]) -> None:
    """Not where whole ones are: candidates that are not in those count as given no chance."""
    path = _reached_at(job)
    path.parent.mkdir(parents=True, exist_ok=True)
    made = Withheld(file=job.listed["file"], outcomes=outcomes).model_dump(mode="json")
    write_atomically(path, json.dumps(made, allow_nan=False).encode())


def _end_withheld(job: Job, outcomes: dict[str, Outcome]) -> None:
    write_withheld(job.results, Withheld(file=job.listed["file"], outcomes=outcomes))
    _reached_at(job).unlink(missing_ok=True)


def contenders(verdict: Verdict) -> list[str]:
    """Candidates on which a verdict rested: none where there was no gap."""
    if verdict.verdict == "no_gap":
        return []
    rested = {*verdict.named, *verdict.chosen}
    return [name for name, p in verdict.pointed.items() if p >= CHANCE or name in rested]


def _outcome(listed: dict[str, Any], judge: Callable[[], Verdict]) -> Outcome:
    began, used = time.perf_counter(), time.process_time()
    verdict, failure = None, ""
    try:
        verdict = judge()
    except Exception as error:  # whatever goes wrong, a recording without a verdict is a wrong answer, not a lost one
        failure = f"{type(error).__name__}: {error}"
    return Outcome(
        file=listed["file"],
        sha256=listed["sha256"],
        seconds=time.perf_counter() - began,
        cpu_seconds=time.process_time() - used,
        verdict=verdict,
        failure=failure,
        program=program(),
    )


def lost(job: Job, seconds: float, why: str) -> None:
    """Write down a failure for what a process that has ended did not write."""
    file = job.listed["file"]
    failed = Outcome(file=file, sha256=job.listed["sha256"], seconds=seconds, failure=why, program=program())
    if not (job.results / VERDICTS / name_of(file)).exists():
        write_outcome(job.results, failed)
    if job.leave_one_out and not (job.results / WITHOUT / name_of(file)).exists():
        first = read_outcome(job.results, file).verdict
        names = [] if first is None else contenders(first)
        _end_withheld(job, dict.fromkeys(names, failed) | _reached(job))


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
    progress: Progress = lambda done, recordings: None,
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
        (:data:`diagnosis.blind.running.CHANCE`); the score uses the verdicts without the one that is true.
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
    done = len(listed) - len(jobs)
    progress(done, len(listed))

    def tell() -> None:
        nonlocal done
        done += 1
        progress(done, len(listed))

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
