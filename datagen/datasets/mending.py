"""``repair``: simulate the damaged shards of a dataset again, and nothing else."""

from __future__ import annotations

import socket
from dataclasses import replace
from pathlib import Path

from datagen.datasets.inspection import find_faults
from datagen.farming.card import write_card
from datagen.farming.cluster import connect
from datagen.farming.collection import Collection
from datagen.farming.failures import Failures
from datagen.farming.package import package_hash, weather_hashes
from datagen.farming.plan import Piece, settings_text
from datagen.farming.usual import TIMEOUT
from datagen.farming.versions import in_words
from datagen.farming.worker import Job, ShardResult
from datagen.fmi.fmu import fmu_sha256
from shared.errors import DatasetError, SimulationError
from shared.lock import FolderLock, read_holder
from shared.places import is_url, url_of
from shared.schema import newer_minor
from shared.store import MANIFEST, DatasetFolder
from shared.system import System, load_system
from shared.watchdog import check_timeout


class _Repair(Collection):
    """A collection that takes only shards with the very content that the manifest promises."""

    replaces = True

    def take(self, piece: Piece, result: ShardResult) -> None:
        old = self._entries[piece.file]
        path = self.folder / "shards" / piece.file
        for failure in result.failures:  # none of them had failed when the shard was made
            raise SimulationError(
                f"{path}: system {failure['system']} could not be simulated again: {failure['cause']}; the shard was "
                "left as it is"
            )
        if result.entry is None or result.entry.content_hash != old.content_hash:
            raise DatasetError(
                f"{path}: simulated again, its content differs from the manifest's; it "
                f"was left as it is. Made with {' or '.join(in_words(self.manifest))}; expected the same versions here"
            )
        seed = old.root_seed
        entry = result.entry.model_copy(update={"root_seed": seed})
        super().take(piece, replace(result, entry=entry))


def repair(
    folder: Path | str,
    system: Path | str | None = None,
    *,
    workers: int = 1,
    timeout: float = TIMEOUT,
    quiet: bool = True,
) -> list[str]:
    """Simulate every damaged or missing shard again; returns the files that were mended.

    Parameters
    ----------
    system
        The system description; by default the one that the last run on this machine used.
    timeout
        Seconds that one system may take.

    Raises
    ------
    DatasetError
        If the system or its FMU is not the dataset's, or what comes out is not what the manifest promises.
    SimulationError
        If a system cannot be simulated any more.
    """
    check_timeout(timeout)
    if is_url(folder):
        raise DatasetError(f"{url_of(folder)}: is a URL; expected a folder to repair: `datagen copy` it into one first")
    dataset = DatasetFolder(folder)
    if said := newer_minor(dataset.manifest.schema_version):  # what is new in it would be lost
        raise DatasetError(f"{dataset.folder / MANIFEST}: {said}")
    described = _find_system(dataset, system)
    with FolderLock(dataset.folder, str(described.path.resolve())):
        dataset = DatasetFolder(folder)  # another run may have ended before the lock was ours
        described = _find_system(dataset, described.path)
        manifest = dataset.manifest
        broken = {fault.entry.file: fault.entry for fault in find_faults(dataset) if fault.entry is not None}
        failures = Failures.read(dataset.folder)
        weather = weather_hashes(described)
        job = Job(
            system=described.canonical(),
            system_path=str(described.path.resolve()),
            fmu_sha256=manifest.fmu_sha256,
            root_seed=manifest.root_seed,
            excitation=bool(manifest.settings.get("excitation", True)),
            calm=float(manifest.settings.get("calm", 0.0)),
            uncertain="uncertain" in manifest.settings,
            folder=str(dataset.folder.resolve()),
            settings=settings_text(manifest),
            package=package_hash(manifest.fmu_sha256, weather),
            timeout=timeout,
            token="",  # workers hand their files back: nothing is overwritten before it has been compared
        )
        by_seed: dict[int, list[Piece]] = {}
        for entry in broken.values():
            seed = manifest.seed_of(entry)
            by_seed.setdefault(seed, []).append(Piece(entry.file, tuple(entry.systems), seed))
        if by_seed:
            with connect(workers=workers) as client:
                for seed, pieces in by_seed.items():
                    one = replace(job, root_seed=seed)
                    # what had failed when the dataset was made stays so, and none of it is simulated here
                    collection = _Repair(dataset.folder, manifest, failures, one, described, budget=1.0)
                    collection.collect(client, iter(pieces), quiet=quiet)
        write_card(dataset.folder, manifest, dataset.system)
    return sorted(broken)


def _last_system(folder: Path) -> str | None:
    """Description of the last run, if that was on this machine; never one that came along with the dataset.

    A description names an FMU, and a repair runs it: from elsewhere, the user must have named it.
    """
    last = read_holder(folder)
    found = last.get("system")
    if last.get("host") != socket.gethostname() or not isinstance(found, str) or not Path(found).is_absolute():
        return None
    return None if Path(found).resolve().is_relative_to(folder.resolve()) else found


def _find_system(dataset: DatasetFolder, system: Path | str | None) -> System:
    manifest = dataset.manifest
    origin = system or _last_system(dataset.folder)
    if not origin:
        raise DatasetError(f"{dataset.folder}: its system description is not known here; name it with --system")
    described = load_system(origin)
    if described.hash() != manifest.system_hash:
        raise DatasetError(f"{described.path}: not the system of {dataset.folder}; name the right one with --system")
    if fmu_sha256(described.fmu_path) != manifest.fmu_sha256:
        raise DatasetError(f"{described.fmu_path}: not the FMU that {dataset.folder} was made with")
    weather = manifest.settings.get("weather")
    if weather is not None and weather != weather_hashes(described):
        raise DatasetError(f"{described.path}: its weather files are not those that {dataset.folder} was made with")
    # neither is part of the hash that was compared
    return described.model_copy(update={"experiment": dataset.system.experiment, "uncertain": dataset.system.uncertain})
