"""The farm: fans the shards of a dataset out over Dask workers and keeps the manifest.

The client keeps a bounded number of shards in flight, records each as it comes back, and may be stopped at any time:
the next run on the same folder goes on where the manifest ends.
"""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from dask.distributed import Client, LocalCluster, as_completed
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from datagen.card import write_card
from datagen.fmu import fmu_sha256
from datagen.liveness import check_live
from datagen.simulator import Simulator
from datagen.worker import Job, ShardResult, shard_name, simulate_shard
from shared.ceiling import FILE_NAME as CEILING_FILE
from shared.ceiling import read_ceilings
from shared.errors import DatasetError, SimulationError
from shared.store import Manifest, read_manifest, write_atomically, write_manifest
from shared.system import System, load_system

IN_FLIGHT_PER_WORKER = 3
FAILURE_BUDGET = 0.05
"""Share of systems that may fail before a run is stopped."""
MANIFEST_EVERY = 5.0
"""Seconds between two writes of the manifest while shards come in."""


def run(
    system: Path | str | System,
    out: Path | str,
    *,
    systems: int,
    hours: float | None = None,
    step: float | None = None,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    shard_size: int = 10,
    excitation: bool = True,
    quiet: bool = False,
) -> Manifest:
    """Simulate ``systems`` random systems into the dataset folder ``out``; an unfinished dataset is resumed.

    Parameters
    ----------
    system
        A system description or its path.
    hours, step
        Length [h] and output step [s], by default the description's.
    workers
        Processes of a local cluster, by default one a core.
    scheduler
        Address of a running Dask scheduler, in place of a local cluster.
    shard_size
        Systems per shard.

    Raises
    ------
    DatasetError
        If ``out`` holds another dataset.
    SimulationError
        If more systems fail than the failure budget allows.
    """
    described = load_system(system) if not isinstance(system, System) else system
    described = described.with_experiment(hours=hours, step=step)
    if systems < 1:
        raise DatasetError(f"systems is {systems}; expected at least 1")
    simulator = Simulator(described)
    check_live(simulator)
    folder = Path(out)
    manifest = _open_or_start(folder, described, systems, seed, shard_size, excitation, simulator.fmu.sha256)
    job = Job(
        system=described.canonical(),
        system_path=str(described.path.resolve()),
        fmu_sha256=manifest.fmu_sha256,
        root_seed=seed,
        excitation=excitation,
        folder=str(folder.resolve()),
    )
    missing = _missing(manifest)
    if missing:
        with _cluster(workers, scheduler, quiet) as client:
            _collect(client, job, manifest, missing, folder, quiet)
    _copy_ceilings(described, folder)
    write_card(folder, manifest, described)
    return manifest


def _open_or_start(
    folder: Path, system: System, systems: int, seed: int, shard_size: int, excitation: bool, fmu_hash: str
) -> Manifest:
    settings: dict[str, Any] = {**system.experiment.model_dump(), "excitation": excitation}
    wanted = Manifest(
        system_name=system.name,
        system_hash=system.hash(),
        system=system.canonical(),
        fmu_sha256=fmu_hash,
        root_seed=seed,
        systems=systems,
        shard_size=shard_size,
        settings=settings,
        versions=_versions(),
    )
    if (folder / "manifest.json").exists():
        found = read_manifest(folder)
        for field in ("system_hash", "fmu_sha256", "root_seed", "systems", "shard_size", "settings"):
            if getattr(found, field) != getattr(wanted, field):
                raise DatasetError(
                    f"{folder / 'manifest.json'}: {field} is {getattr(found, field)}, this run has "
                    f"{getattr(wanted, field)}; a dataset can only be resumed with its own settings"
                )
        return found
    if folder.exists() and any(folder.iterdir()):
        raise DatasetError(f"{folder}: not empty and without a manifest; expected a new folder or a dataset")
    (folder / "shards").mkdir(parents=True, exist_ok=True)
    write_manifest(folder, wanted)
    return wanted


def _versions() -> dict[str, str]:
    packages = ("zeroshot-fmu", "fmpy", "dask", "numpy", "netCDF4", "xarray", "pvlib", "numba")
    return {"python": platform.python_version(), **{name: version(name) for name in packages}}


def _missing(manifest: Manifest) -> list[tuple[int, list[int]]]:
    """Shards that the manifest does not list, by number, with their systems."""
    have = {entry.file for entry in manifest.shards}
    count = -(-manifest.systems // manifest.shard_size)
    spans = ((n, n * manifest.shard_size) for n in range(count) if shard_name(n) not in have)
    return [(n, list(range(first, min(first + manifest.shard_size, manifest.systems)))) for n, first in spans]


@contextmanager
def _cluster(workers: int | None, scheduler: str | None, quiet: bool) -> Iterator[Client]:
    if scheduler:
        with Client(scheduler) as client:
            yield client
        return
    # loopback only: a dashboard or scheduler that others should reach is something to ask for
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",
            silence_logs=40,
        ) as cluster,
        Client(cluster) as client,
    ):
        if not quiet:
            Console().print(f"{len(cluster.workers)} workers; dashboard at {cluster.dashboard_link}", markup=False)
        yield client


def _collect(
    client: Client, job: Job, manifest: Manifest, missing: list[tuple[int, list[int]]], folder: Path, quiet: bool
) -> None:
    workers = max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)
    waiting = iter(missing)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[rate]}"),
    )
    failed: list[dict[str, Any]] = _read_failures(folder)
    written = time.monotonic()
    began = time.monotonic()
    finished = 0
    with Progress(*columns, disable=quiet) as progress:
        done = sum(len(entry.systems) for entry in manifest.shards)
        bar = progress.add_task("simulating", total=manifest.systems, completed=done, rate="")
        futures = as_completed([], with_results=True)
        flying = 0

        def submit() -> int:
            item = next(waiting, None)
            if item is None:
                return 0
            number, indices = item
            futures.add(client.submit(simulate_shard, job, number, indices, pure=False, key=f"shard-{number}"))
            return 1

        for _ in range(IN_FLIGHT_PER_WORKER * workers):
            flying += submit()
        while flying:
            _, result = next(futures)
            flying += submit() - 1
            assert isinstance(result, ShardResult)
            if result.entry is not None:
                manifest.shards.append(result.entry)
            failed.extend(result.failures)
            count = len(result.failures) + (len(result.entry.systems) if result.entry else 0)
            finished += count
            rate = finished / (time.monotonic() - began)
            progress.update(bar, advance=count, rate=f"{rate:.2f} systems/s")
            if result.failures:
                lines = "".join(json.dumps(one) + "\n" for one in failed)
                write_atomically(folder / "failures.jsonl", lines.encode())
            if len(failed) > max(FAILURE_BUDGET * manifest.systems, 1):
                _store(folder, manifest)
                raise SimulationError(
                    f"{folder}: {len(failed)} systems failed, more than {FAILURE_BUDGET:.0%} of {manifest.systems}; "
                    f"see failures.jsonl. The last: {failed[-1]['cause']}"
                )
            if time.monotonic() - written > MANIFEST_EVERY:
                _store(folder, manifest)
                written = time.monotonic()
    if not (folder / "failures.jsonl").exists():
        write_atomically(folder / "failures.jsonl", b"")
    _store(folder, manifest)


def _store(folder: Path, manifest: Manifest) -> None:
    manifest.shards.sort(key=lambda entry: entry.file)
    write_manifest(folder, manifest)


def _read_failures(folder: Path) -> list[dict[str, Any]]:
    path = folder / "failures.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def _copy_ceilings(system: System, folder: Path) -> None:
    """Put the ceilings that lie beside the description into the dataset, if they are of this very system and FMU."""
    beside = system.path.parent / CEILING_FILE
    if not beside.exists():
        return
    ceilings = read_ceilings(beside)
    if ceilings.system_hash == system.hash() and ceilings.fmu_sha256 == fmu_sha256(system.fmu_path):
        write_atomically(folder / CEILING_FILE, beside.read_bytes())
