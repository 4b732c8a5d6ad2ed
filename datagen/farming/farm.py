"""The farm: fans the shards of a dataset out over workers and keeps the manifest.

A run may be stopped at any time and in any way: the next one on the same folder goes on where it ended, with the same
data.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from datagen.farming.card import write_card
from datagen.farming.cluster import QUEUES, check_places, connect
from datagen.farming.collection import Collection
from datagen.farming.dask_worker import RECYCLE
from datagen.farming.dispatch import PATIENCE
from datagen.farming.failures import FILE_NAME as FAILURES_FILE
from datagen.farming.failures import Failures
from datagen.farming.package import package_hash, weather_hashes
from datagen.farming.plan import adopt, check_sizes, missing, settings_text
from datagen.farming.usual import FAILURE_BUDGET, TIMEOUT
from datagen.farming.versions import all_here, note
from datagen.farming.worker import Job
from datagen.fmi.fmu import fmu_sha256
from datagen.simulating.liveness import check_live_apart
from datagen.simulating.simulator import Simulator
from shared.ceiling import FILE_NAME as CEILING_FILE
from shared.ceiling import Origin, fitting, read_ceilings, unknown_constants, write_ceilings
from shared.errors import DatasetError
from shared.lock import FILE_NAME as LOCK_FILE
from shared.lock import FolderLock
from shared.logs import log_files, logger
from shared.places import check_folder
from shared.schema import newer_minor
from shared.store import MANIFEST, Manifest, read_manifest, write_atomically, write_manifest
from shared.system import System, load_system
from shared.watchdog import check_timeout

_log = logger(__name__)
_FIXED = ("system_hash", "fmu_sha256", "root_seed", "shard_size", "settings")


def run(
    system: Path | str | System,
    out: Path | str,
    *,
    systems: int | None = None,
    preset: str | None = None,
    hours: float | None = None,
    step: float | None = None,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    cluster: str = "local",
    cluster_options: Mapping[str, str] | None = None,
    host: str | None = None,
    shard_size: int = 10,
    excitation: bool = True,
    calm: float = 0.0,
    uncertain: bool = False,
    disturbed: float = 0.0,
    extend: bool = False,
    retry_failures: bool = False,
    failure_budget: float = FAILURE_BUDGET,
    timeout: float = TIMEOUT,
    recycle: float = RECYCLE,
    quiet: bool = False,
) -> Manifest:
    """Simulate ``systems`` random systems into the dataset folder ``out``; an unfinished dataset is resumed.

    Parameters
    ----------
    system
        A system description or its path.
    preset
        One of the description's: gives ``start``, and ``systems``, ``hours``, ``step`` where they are not given here.
    hours, step
        Length [h] and output step [s], by default the description's.
    workers, scheduler, cluster, cluster_options, host
        Where the work is done; see :func:`datagen.farming.cluster.connect`.
    shard_size
        Systems per shard.
    excitation
        Whether inputs of source ``excitation`` act.
    calm
        Share of the systems, drawn by chance, in which they do not.
    uncertain
        Draw the description's uncertain constants for each system, in place of their values.
    disturbed
        Share of the systems on which one or two of the description's effects act, as random processes.
    extend
        Allow more systems than the dataset was started with; the shards that are there stay as they are.
    retry_failures
        Simulate the systems in ``failures.jsonl`` once more.
    failure_budget
        Share of the systems, 0 to 1, that may fail before the run is stopped.
    timeout
        Seconds that one system may take.
    recycle
        Bytes by which a worker process may grow before a fresh one takes its place.

    Raises
    ------
    DatasetError
        If ``out`` holds another dataset, cannot be written to, or another run is at it, or an option is out of range.
    ClusterError
        If the workers that are asked for cannot be had.
    SimulationError
        If more systems fail than the failure budget allows, or more than half of the first twenty or more do (not with
        a budget of a half or more, nor where failed ones are tried again).
    """
    described = load_system(system) if not isinstance(system, System) else system
    if preset is not None:
        chosen = described.preset(preset)
        systems = chosen.systems if systems is None else systems  # a zero that was asked for is refused below
        hours, step = chosen.hours if hours is None else hours, chosen.step if step is None else step
        described = described.with_experiment(start=chosen.start)
    if systems is None:
        raise DatasetError("systems is missing; expected a number of systems, or a preset")
    _check_shares(described, excitation=excitation, calm=calm, uncertain=uncertain, disturbed=disturbed)
    _check_numbers(seed, failure_budget)
    check_timeout(timeout)
    places: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "cluster": cluster, "host": host}
    places["options"] = cluster_options
    check_places(**places)
    described = described.with_experiment(hours=hours, step=step)
    check_sizes(described, systems, shard_size)
    fmu_hash = Simulator(described).fmu.sha256
    weather = weather_hashes(described)
    settings = {**described.experiment.model_dump(mode="json"), "excitation": excitation, "weather": weather}
    settings |= _settings(described, calm=calm, uncertain=uncertain, disturbed=disturbed)
    wanted = Manifest(
        system_name=described.name,
        system_hash=described.hash(),
        system=described.canonical(),
        fmu_sha256=fmu_hash,
        root_seed=seed,
        systems=systems,
        shard_size=shard_size,
        settings=settings,
        versions=all_here(),
    )
    folder = Path(out)
    where = str(described.path.resolve())
    _check_folder(folder)
    if not (folder / MANIFEST).exists():
        check_live_apart(described, timeout)
    try:
        (folder / "shards").mkdir(parents=True, exist_ok=True)
        with FolderLock(folder, where) as lock:
            manifest = _open_or_start(folder, wanted, extend)
            failures = Failures.read(folder)
            text = settings_text(manifest)
            _clear(folder)
            manifest.shards += adopt(folder, manifest, failures, text)
            job = Job(
                system=described.canonical(),
                system_path=where,
                fmu_sha256=fmu_hash,
                root_seed=seed,
                excitation=excitation,
                calm=calm,
                uncertain=uncertain,
                disturbed=disturbed,
                folder=str(folder.resolve()),
                settings=text,
                package=package_hash(fmu_hash, weather),
                token=lock.token,
                timeout=timeout,
                recycle=recycle,
            )
            collection = Collection(
                *(folder, manifest, failures, job, described), budget=failure_budget, retry=retry_failures
            )
            try:
                collection.store()
                pieces = missing(manifest, failures, retry=retry_failures)
                first = next(pieces, None)
                if first is not None:
                    with connect(**places) as client:
                        note(manifest, all_here(), folder, "this run")  # before a shard is there that they made
                        collection.store()
                        patience = float("inf") if cluster in QUEUES else PATIENCE  # jobs may be queued for days
                        collection.collect(client, chain([first], pieces), quiet=quiet, patience=patience)
                if not (folder / FAILURES_FILE).exists():
                    failures.write(folder)
                _copy_ceilings(described, folder, excitation=excitation and not calm, uncertain=uncertain)
            except BaseException:  # the card says what the manifest says, if it can; what went wrong is told either way
                with suppress(OSError):
                    _clear(folder)
                    write_card(folder, manifest, described)
                raise
            _clear(folder)  # a worker that was killed in this run may have been writing
            write_card(folder, manifest, described)
    except OSError as error:
        raise DatasetError(
            f"{error.filename or folder}: cannot be written: {error.strerror or error}; "
            "what was finished is kept, the same command goes on from there"
        ) from None
    return manifest


def _check_shares(described: System, *, excitation: bool, calm: float, uncertain: bool, disturbed: float) -> None:
    """Refuse what is to be drawn and is not in the description, and shares that are none."""
    if not 0 <= calm < 1 or (calm and not excitation):
        raise DatasetError(
            f"calm is {calm:g}{'' if excitation else ' and excitation is off'}; expected a share from 0 to less than 1"
            " of the systems, of which the others are excited"
        )
    if calm and not any(one.source == "excitation" for one in described.inputs):
        raise DatasetError(f"calm is {calm:g}; expected 0: {described.path} has no input of source 'excitation'")
    if uncertain and not described.uncertain:
        raise DatasetError(f"uncertain is set; expected an [[uncertain]] table in {described.path}, which has none")
    if not 0 <= disturbed <= 1 or (disturbed and not described.effects):
        raise DatasetError(
            f"disturbed is {disturbed:g}; expected a share from 0 to 1 of the systems"
            + ("" if described.effects else f", or 0: {described.path} has no [[effects]]")
        )


def _check_numbers(seed: int, failure_budget: float) -> None:
    if seed < 0:
        raise DatasetError(f"seed is {seed}; expected at least 0")
    if not 0 <= failure_budget <= 1:  # of a NaN no comparison holds
        raise DatasetError(f"failure_budget is {failure_budget:g}; expected a share from 0 to 1 of the systems")


def _settings(described: System, *, calm: float, uncertain: bool, disturbed: float) -> dict[str, Any]:
    """What is drawn besides parameters, for the manifest. What is not is left out: earlier datasets do not know it."""
    found: dict[str, Any] = {"calm": calm} if calm else {}
    if uncertain:
        found["uncertain"] = [one.model_dump(mode="json") for one in described.uncertain]
    if disturbed:
        found |= {"disturbed": disturbed, "effects": [one.model_dump(mode="json") for one in described.effects]}
    return found


def _check_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise DatasetError(f"{folder}: a file; expected a new folder or a dataset")
    check_folder(folder, DatasetError)
    if not folder.exists() or (folder / MANIFEST).exists():
        return
    ours = {LOCK_FILE, "shards"}  # of a run that was stopped before it had written a manifest
    found = [path for path in folder.iterdir() if path.resolve() not in log_files()]
    if any(path.name not in ours and not path.name.endswith(".tmp") for path in found):
        raise DatasetError(f"{folder}: not empty and without a manifest; expected a new folder or a dataset")


def _open_or_start(folder: Path, wanted: Manifest, extend: bool) -> Manifest:
    where = folder / MANIFEST
    found = read_manifest(folder) if where.exists() else None
    if found is None or _empty(folder, found):  # what was begun with other settings and has nothing binds nobody
        write_manifest(folder, wanted)
        return wanted
    if found.sources:
        raise DatasetError(f"{where}: merged from other datasets; extend or resume one of those, and merge again")
    ours, theirs = (one.schema_version for one in (wanted, found))
    if ours.partition(".")[0] != theirs.partition(".")[0]:  # minor versions have the same values
        raise DatasetError(
            f"{where}: schema_version is {theirs}, this run has {ours}; a dataset can only be resumed or extended with "
            "its own schema: simulate a new one"
        )
    if said := newer_minor(theirs):  # what is new in it would be lost
        raise DatasetError(f"{where}: {said}")
    for field in _FIXED:
        before, now = getattr(found, field), getattr(wanted, field)
        if before != now:
            if isinstance(before, dict):  # of a dozen settings the one that differs
                name = next(one for one in {**before, **now} if before.get(one) != now.get(one))
                field, before, now = f"{field}.{name}", before.get(name, "not set"), now.get(name, "not set")
            raise DatasetError(
                f"{where}: {field} is {before}, this run has {now}; a dataset can only be resumed with its own settings"
            )
    if wanted.systems == found.systems:
        return found
    if wanted.systems < found.systems or not extend:
        raise DatasetError(
            f"{where}: systems is {found.systems}, this run has {wanted.systems}; a dataset can only be resumed with "
            "its own settings, or given more systems with --extend"
        )
    stages = [*(found.stages or [found.systems]), wanted.systems]
    return found.model_copy(update={"systems": wanted.systems, "stages": stages})


def _empty(folder: Path, found: Manifest) -> bool:
    """Whether a dataset was begun and has no system, simulated or failed: its workers were never there."""
    return not (
        found.shards or found.sources or (folder / FAILURES_FILE).exists() or any((folder / "shards").iterdir())
    )


def _clear(folder: Path) -> None:
    """Remove what writers left unfinished."""
    for path in [*folder.glob(".*.tmp"), *(folder / "shards").glob(".*.tmp")]:
        path.unlink(missing_ok=True)


def _copy_ceilings(system: System, folder: Path, *, excitation: bool, uncertain: bool) -> None:
    """Put the ceilings beside the description into the dataset, if any is for this very dataset.

    That is, of its system, FMU, season, weather, and of constants that are drawn or as declared, as its own are. Limits
    that the dataset has already are joined: of the same condition and season those of more systems stay, or its own.
    """
    beside = system.path.parent / CEILING_FILE
    if not beside.exists():
        return
    ceilings = read_ceilings(beside)
    if ceilings.system_hash == system.hash() and ceilings.fmu_sha256 == fmu_sha256(system.fmu_path):
        if not excitation and any(one.source == "excitation" for one in system.inputs):
            _log.warning("%s: not copied: its ceilings hold with excitation, this dataset is not all with it", beside)
            return
        origin = Origin.of(system.experiment, weather_hashes(system))
        limit, reason = fitting(ceilings.ceilings, origin, unknown_constants(system.uncertain if uncertain else []))
        if limit is None:
            _log.info("%s: not copied: %s", beside, reason)  # nothing is wrong with the dataset
            return
        there = folder / CEILING_FILE
        if not there.exists():
            write_atomically(there, beside.read_bytes())
            return
        own = read_ceilings(there)
        if (own.system_hash, own.fmu_sha256) != (ceilings.system_hash, ceilings.fmu_sha256):
            _log.warning("%s: of another system or FMU than the dataset's; left as it is", there)
            return
        for one in own.ceilings:
            ceilings.put_unless_fewer(one)
        if {one.model_dump_json() for one in ceilings.ceilings} != {one.model_dump_json() for one in own.ceilings}:
            write_ceilings(there, ceilings)
