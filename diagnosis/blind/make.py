"""Write a blind set: a folder of recordings to publish, and beside it the sealed answers."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Callable
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np

from datagen.fmi.fmu import fmu_sha256
from diagnosis.blind.detectability import detectability
from diagnosis.blind.generator import Generator, Made, describe, measured, published, write
from diagnosis.blind.sealed import MANIFEST, made_of, publish, read_manifest, salt_of, seal, source_sha256
from diagnosis.blind.truth import default_truth, load_truth
from diagnosis.effects import library
from diagnosis.recording import DAY, HOUR
from diagnosis.where.series import FEWEST
from shared.children import starting, worker_pool
from shared.errors import RecordingError, SimulationError, ZeroshotError
from shared.lock import FolderLock
from shared.logs import log_files
from shared.places import check_folder
from shared.reading import read_json
from shared.store import sha256_of, write_atomically
from shared.system import System, load_system


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


HOURS = 672.0
RECORDINGS = "recordings"
ATTEMPTS = 5
"""How often a recording is drawn that cannot be simulated."""
_DIGITS = 7
"""Significant digits of the sealed series: below the sensors' floor."""

Progress = Callable[[int, int], object]


def make(
    system: System | Path | str,
    out: Path | str,
    *,
    recordings: int = 200,
    seed: int | None = None,
    answers: Path | str | None = None,
    truth: Path | str | None = None,
    hours: float = HOURS,
    workers: int = 1,
    progress: Progress = lambda done, recordings: None,
) -> dict[str, Any]:
    """Write recordings whose effect is sealed, and return the manifest.

    Until all are made they lie with their answers beside the sealed file, in a folder with ``.part`` after its name;
    the same call goes on from there.

    Parameters
    ----------
    out
        Folder of what is published: ``recordings/*.nc`` and ``manifest.json``.
    seed
        Decides all; drawn if not given. It is sealed with the answers: who knows it can make the set again.
    answers
        The sealed file; beside the folder, with ``.answers.json`` after its name, if not given.
    truth
        The truth's TOML; ``truth/truth.toml`` beside the system's folder if not given.
    hours
        Length of each recording [h], at least a day and four steps.
    workers
        Processes. A recording depends on the seed and its number alone.

    Raises
    ------
    RecordingError
        If there is something in the folder, the sealed file exists, one lies in the other, nothing can be written
        there, recordings would be too short for a diagnosis, another call is at it, or what was begun was begun
        otherwise.
    SystemDescriptionError, FmuError, SimulationError
        If system or truth cannot be used.
    """
    described = system if isinstance(system, System) else load_system(system)
    where = Path(truth) if truth is not None else default_truth(described)
    fmu = where.parent / load_truth(where, described).fmu
    folder = Path(out)
    sealed = Path(answers) if answers is not None else folder.with_name(f"{folder.name}.answers.json")
    part = sealed.with_name(f"{sealed.name}.part")
    if recordings < 1:
        raise ValueError(f"recordings is {recordings}; expected at least 1")
    width = max(len(str(recordings - 1)), 4)
    copied = {f"{RECORDINGS}/{index:0{width}}.nc": _recording(part, index) for index in range(recordings)}
    check_new(folder, sealed, copied)
    described.with_experiment(hours=hours)  # hours that no simulation can have are refused before anything is begun
    _check_length(hours, described.experiment.step)
    about = {
        "system_name": described.name,
        "system_hash": described.hash(),
        "fmu_sha256": fmu_sha256(described.fmu_path),
        "uncertain_sha256": uncertain_sha256(described),
        "step": described.experiment.step,
        "hours": hours,
    }
    begun = {
        **about,
        "recordings": recordings,
        "truth": sha256_of(where),
        "truth_fmu": fmu_sha256(fmu),
        # the system's own hash leaves out what it may be simulated with, and what diagnosis tries
        "description": hashlib.sha256(described.canonical().encode()).hexdigest(),
        "library": [one.name for one in library(described)],
        "program": program_sha256(),
    }
    part.mkdir(parents=True, exist_ok=True)
    with FolderLock(part, str(described.path.resolve()), kind=RecordingError):  # two calls would have two seeds
        chosen = begin(part, begun, seed)
        jobs = [(chosen, index, part) for index in range(recordings) if not _answer(part, index).exists()]
        _work_off(described, where, hours, jobs, workers, progress, recordings)
        opened = [
            {"file": file, **read_json(_answer(part, index), RecordingError, "an answer of a set that is being made")}
            for index, file in enumerate(copied)
        ]
        sources = made_of(described, where)
        digest = seal(sealed, {"salt": salt_of(chosen), "seed": chosen, **sources, **about, "recordings": opened})
        check_new(folder, sealed, copied)  # a call with other answers may have published there
        manifest = {**about, "answers_sha256": digest, "recordings": _published(folder, copied, opened)}
        publish(folder, manifest)
    shutil.rmtree(part)
    return manifest


def _check_length(hours: float, step: float) -> None:
    """Refuse recordings that no diagnosis would read."""
    if hours * HOUR < max(DAY, FEWEST * step):
        raise RecordingError(
            f"hours is {hours:g}; expected at least {max(DAY, FEWEST * step) / HOUR:g}: a diagnosis reads no recording"
            f" that is shorter than a day or than {FEWEST} steps"
        )


def _published(folder: Path, copied: dict[str, Path], opened: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Copy the recordings to where they are published, and say what is published of each."""
    (folder / RECORDINGS).mkdir(parents=True, exist_ok=True)
    listed = []
    for (file, path), answer in zip(copied.items(), opened, strict=True):
        # written anew and in order: when a file was made would tell how long its simulation took
        write_atomically(folder / file, path.read_bytes())
        os.utime(folder / file, (0, 0))
        conditions = {"occupancy": answer["occupancy"], "replay": answer["replay"]}
        listed.append({"file": file, "sha256": sha256_of(folder / file), **conditions})
    return listed


def _recording(part: Path, index: int) -> Path:
    return part / f"{index}.nc"


def _answer(part: Path, index: int) -> Path:
    return part / f"{index}.json"


Job = tuple[int, int, Path]


def _work_off(
    system: System,
    truth: Path,
    hours: float,
    jobs: list[Job],
    workers: int,
    progress: Progress,
    total: int,
) -> None:
    """Make what is missing."""
    done = total - len(jobs)
    progress(done, total)
    if workers <= 1:
        generator = Generator(system, load_truth(truth, system), hours=hours)
        for k, job in enumerate(jobs, done + 1):
            write_one(generator, *job)
            progress(k, total)
        return
    try:
        with worker_pool(workers, _prepare, (system, truth, hours)) as pool:
            with starting():  # the first one starts the processes
                futures = [pool.submit(_work, job) for job in jobs]
            for k, future in enumerate(as_completed(futures), done + 1):
                future.result()
                progress(k, total)
    except BrokenProcessPool:
        raise SimulationError(
            f"{system.fmu_path} or the FMU of {truth}: took a process down that made recordings of {hours:g} h, or"
            " memory ran out; expected FMUs that bear every parameter within its range, or fewer workers; what was"
            " made is kept, and the same call goes on from there"
        ) from None


_generator: Generator | ZeroshotError | None = None


def _prepare(system: System, truth: Path, hours: float) -> None:
    global _generator
    try:
        _generator = Generator(system, load_truth(truth, system), hours=hours)
    except ZeroshotError as error:  # raised here it would take the pool down and say nothing
        _generator = error


def _work(job: Job) -> None:
    if isinstance(_generator, ZeroshotError):
        raise _generator
    assert _generator is not None
    write_one(_generator, *job)


def write_one(generator: Generator, seed: int, index: int, part: Path) -> None:
    """Make one recording: write it and then its answer. What cannot be simulated is drawn anew, a few times.

    Raises
    ------
    SimulationError
        If no draw could be simulated.
    """
    for attempt in range(ATTEMPTS):
        try:
            return _write(generator, seed, index, attempt, part)
        except SimulationError as error:
            last = error
    raise SimulationError(
        f"{generator.truth.path}: recording {index} of this seed could not be made, none of its {ATTEMPTS} draws;"
        f" expected FMUs that bear every parameter within its range; the last draw: {last}"
    )


def _write(generator: Generator, seed: int, index: int, attempt: int, part: Path) -> None:
    made = generator.make(seed, index, attempt)
    outputs, noises = measured(made, generator.system, generator.truth)
    write(_recording(part, index), published(made, outputs, generator.system, generator.truth))
    answer = answer_of(made, noises, generator.system)
    answer["detectability"] = detectability(generator.model, _recording(part, index), answer, generator.effects)
    write_atomically(_answer(part, index), json.dumps(answer).encode())


def answer_of(made: Made, noises: dict[str, dict[str, float]], system: System) -> dict[str, Any]:
    """What is sealed of one recording.

    ``verdict`` and ``effects`` are the right answer; ``gap`` is the root mean square of what the base model with the
    true parameters and constants misses of the noise-free record [unit of each output], and ``gap_over_noise`` that
    over the noise; ``clean`` and ``base`` are the two series; ``attempt`` counts draws that could not be simulated.
    """
    case = made.case
    effects = [cause.label for cause in case.causes]
    gap = np.sqrt(np.mean((made.clean - made.base) ** 2, axis=1))
    verdict = "no_gap" if not case.causes else "effect" if all(effects) else "none_of_these"
    sds = np.hypot([noises[o.name]["sd"] for o in system.outputs], [o.accuracy for o in system.outputs])
    return {
        "stratum": case.stratum,
        "attempt": case.attempt,
        "verdict": verdict,
        "effects": [name for name in effects if name],
        "causes": [describe(cause) for cause in case.causes],
        "occupancy": "unknown" if case.unknown_occupancy else "measured",
        "replay": case.replay,
        "start": made.start,
        "parameters": made.parameters,
        "constants": made.constants,
        "controllers": made.controllers,
        "noise": noises,
        "gap": dict(zip(system.output_names, gap.tolist(), strict=True)),
        "gap_over_noise": dict(zip(system.output_names, (gap / sds).tolist(), strict=True)),
        "clean": _series(system, made.clean),
        "base": _series(system, made.base),
    }


def _series(system: System, values: np.ndarray) -> dict[str, list[float]]:
    return {
        name: [float(f"{x:.{_DIGITS}g}") for x in row] for name, row in zip(system.output_names, values, strict=True)
    }
