"""What a worker does: simulate the systems of one shard and write it.

A system's data depend on the root seed and its index alone, so it does not matter which worker does it, or when.
"""

from __future__ import annotations

import faulthandler
import os
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import dask
import numpy as np
import psutil

from datagen.driving.disturbances import number_of
from datagen.driving.sampling import is_calm, record_start, sample_parameters, told_values
from datagen.farming.dask_worker import RECYCLE, address, hold_back, named, recycle, this_worker, unpack_in_scratch
from datagen.farming.package import locate, sees_folder
from datagen.farming.usual import TIMEOUT
from datagen.farming.versions import PACKAGE, deciding_here, difference
from datagen.fmi.guard import guarded as in_children
from datagen.simulating.constants import sample_factors
from datagen.simulating.drawn import simulate_system
from datagen.simulating.simulator import Simulator, Trajectory
from shared import __version__
from shared.errors import DatasetError, FmuError, SimulationError
from shared.places import no_temporary_place
from shared.schema import build_shard
from shared.store import ShardEntry, write_shard
from shared.system import System, system_from_canonical

RETRY_TOLERANCES = (1.0, 0.1, 0.01)
"""A system that fails is tried again with the tolerance times these, in this order, then given up."""


@dataclass(frozen=True)
class Job:
    """Everything that decides a dataset's content, the same for all its shards, and how its workers behave.

    ``token`` tells a worker whether it sees the dataset's folder; ``package`` names the files that it needs.
    """

    system: str
    system_path: str
    fmu_sha256: str
    root_seed: int
    excitation: bool
    folder: str
    calm: float = 0.0
    uncertain: bool = False
    disturbed: float = 0.0
    settings: str = ""
    package: str = ""
    token: str = ""
    version: str = __version__
    versions: dict[str, str] = field(default_factory=deciding_here)
    timeout: float = TIMEOUT
    recycle: float = RECYCLE


@dataclass(frozen=True)
class ShardResult:
    """What came of one shard: its entry (None if every system failed), and the systems that failed.

    ``data`` is the file itself, where the worker does not see the dataset's folder. ``lacks_package`` asks for the FMU
    to be sent: nothing was simulated. ``pid`` and ``rss`` [bytes] are the worker's.
    """

    entry: ShardEntry | None = None
    failures: list[dict[str, Any]] = field(default_factory=list)
    data: bytes | None = None
    lacks_package: bool = False
    worker: str = ""
    pid: int = 0
    rss: int = 0


@lru_cache(maxsize=4)
def simulator_for(system: str, system_path: str, package: str = "") -> Simulator | None:
    """The simulator of a system, loaded once per worker process; None if its files are not on this machine."""
    here = locate(system, system_path, package)
    return Simulator(here) if here is not None else None


def attempt(work: tuple[Job, int]) -> Trajectory:
    """Simulate one system of a job, again with tighter tolerances if it fails.

    Raises SimulationError if it failed with every tolerance.
    """
    job, index = work
    simulator = simulator_for(job.system, job.system_path, job.package)
    if simulator is None:  # whoever asked for this looks at the files again, and drops what came of it
        raise FmuError(f"{job.system_path}: its FMU or a weather file changed; expected those that the run began with")
    last = SimulationError("")
    for factor in RETRY_TOLERANCES:
        try:
            return simulate_system(
                simulator,
                root_seed=job.root_seed,
                index=index,
                excitation=job.excitation and not is_calm(job.root_seed, index, job.calm),
                uncertain=job.uncertain,
                disturbed=job.disturbed,
                tolerance=simulator.system.experiment.tolerance * factor,
            )
        except SimulationError as error:
            last = error
    raise last


_ONE_AT_A_TIME = threading.Lock()
"""NetCDF and the watch over a simulation are one per process, however many threads a foreign cluster gives it."""


@contextmanager
def _watch(timeout: float) -> Iterator[None]:
    """End this process if the body takes longer: an FMU that hangs holds the interpreter, so no thread could."""
    with open(os.devnull, "w") as nowhere:
        faulthandler.dump_traceback_later(timeout, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def simulate_shard(job: Job, file: str, indices: Sequence[int], guarded: bool = False) -> ShardResult:
    """Simulate the systems of a shard and write it whole; ``guarded`` in child processes, for one whose worker died.

    Raises DatasetError if this worker has other versions than the client, or has nowhere to write a file.
    """
    with named():
        _check_versions(job)
    with _ONE_AT_A_TIME, named():
        hold_back()
        unpack_in_scratch()
        outcomes = _simulated(job, indices, guarded)
        if outcomes is None:
            return ShardResult(lacks_package=True, worker=address())
        result = _deliver(job, file, indices, outcomes)
        rss = psutil.Process().memory_info().rss
        recycle(job.recycle, rss)
        return ShardResult(**result, worker=address(), pid=os.getpid(), rss=rss)


def _simulated(job: Job, indices: Sequence[int], guarded: bool) -> list[Any] | None:
    """What comes of each system with the files of the job's package; None if they are not on this machine."""
    files = (job.system, job.system_path, job.package)
    while (simulator := simulator_for(*files)) is not None:
        outcomes = _under_guard(job, indices) if guarded else [_outcome(job, index) for index in indices]
        if locate(*files) == simulator.system:
            return outcomes
        simulator_for.cache_clear()  # a file changed since the simulator was made: nobody knows of what these are
    simulator_for.cache_clear()
    return None


def _check_versions(job: Job) -> None:
    ours = deciding_here()
    # the package first: the job of another one may lack the rest
    other = difference(ours, ours | {PACKAGE: job.version}) or difference(ours, job.versions)
    if other is not None:
        raise DatasetError(f"a worker has {other[0]}, this run {other[1]}; expected the same version everywhere")


def _outcome(job: Job, index: int) -> Trajectory | SimulationError:
    with _watch(job.timeout):
        try:
            return attempt((job, index))
        except SimulationError as error:
            return error


def _under_guard(job: Job, indices: Sequence[int]) -> list[Any]:
    limit = psutil.virtual_memory().total / 2
    worker = this_worker()
    if worker is not None and worker.memory_manager.memory_limit:
        limit = worker.memory_manager.memory_limit
    return in_children(attempt, [(job, index) for index in indices], timeout=job.timeout, memory_limit=limit)


def _deliver(job: Job, file: str, indices: Sequence[int], outcomes: list[Any]) -> dict[str, Any]:
    system: System = system_from_canonical(job.system, Path(job.system_path))
    drawn = {index: sample_parameters(system, job.root_seed, index) for index in indices}
    done = [index for index, one in zip(indices, outcomes, strict=True) if isinstance(one, Trajectory)]
    good = [one for one in outcomes if isinstance(one, Trajectory)]
    failures = [
        {
            "system": index,
            "root_seed": job.root_seed,
            "parameters": dict(zip(system.parameter_names, drawn[index].tolist(), strict=True)),
            "cause": str(one),
        }
        for index, one in zip(indices, outcomes, strict=True)
        if not isinstance(one, Trajectory)
    ]
    if not done:
        return {"failures": failures}
    shard = build_shard(
        system,
        indices=np.array(done),
        root_seed=job.root_seed,
        parameters=np.stack([drawn[index] for index in done]),
        outputs=np.stack([one.outputs for one in good]),
        inputs=np.stack([one.inputs for one in good]),
        starts=np.array([record_start(system, job.root_seed, index) for index in done]),
        given=np.stack([told_values(system, job.root_seed, index) for index in done]) if system.told else None,
        disturbances=(
            np.array([number_of(job.root_seed, index, job.disturbed) for index in done]) if job.disturbed else None
        ),
        factors=np.stack([sample_factors(system, job.root_seed, index) for index in done]) if job.uncertain else None,
        attributes={"fmu_sha256": job.fmu_sha256, "root_seed": str(job.root_seed), "settings": job.settings},
    )
    entry, data = _write(job, file, shard, done)
    return {"entry": entry, "failures": failures, "data": data}


def _write(job: Job, file: str, shard: Any, done: list[int]) -> tuple[ShardEntry, bytes | None]:
    """Write a shard into the dataset's folder if this worker sees it, else hand it back as bytes."""

    def still_ours() -> None:
        if not sees_folder(job.folder, job.token):  # a worker may outlive its run, and another may be at work there
            raise OSError(f"{job.folder}: no longer of the run that this is for")

    if sees_folder(job.folder, job.token):
        try:
            return _write_here(Path(job.folder) / "shards" / file, shard, done, still_ours), None
        except OSError:  # read-only here, or full: then the client says so
            pass
    try:
        with tempfile.TemporaryDirectory(prefix="zeroshot-shard-") as folder:
            path = Path(folder) / file
            return _write_here(path, shard, done), path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{file}: on a worker {no_temporary_place(error)} where the worker is started") from None


def _write_here(path: Path, shard: Any, done: list[int], before: Callable[[], None] = lambda: None) -> ShardEntry:
    # inside a Dask worker xarray would ask the scheduler for a lock on the file, which is nobody else's anyway
    with dask.config.set(scheduler="synchronous"):
        return write_shard(path, shard, done, before=before)
