"""``merge``: several datasets of one system, made from different root seeds, become one."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from datagen.datasets.inspection import lacking
from datagen.farming.card import write_card
from datagen.farming.failures import FILE_NAME as FAILURES_FILE
from datagen.farming.failures import Failures
from datagen.farming.versions import note
from shared.ceiling import FILE_NAME as CEILING_FILE
from shared.ceiling import Ceilings, read_ceilings, write_ceilings
from shared.errors import DatasetError
from shared.lock import FILE_NAME as LOCK_FILE
from shared.lock import FolderLock, at_work
from shared.logs import logger
from shared.store import (
    MANIFEST,
    DatasetFolder,
    Manifest,
    ShardEntry,
    Source,
    sha256_of,
    temporary_name,
    write_manifest,
)

_DRAFT = ".merging"
"""In a folder that was there before: what becomes its content. A merge that was killed leaves it."""
_MADE = {"shards", "README.md", FAILURES_FILE, CEILING_FILE}
"""What of that may have got to its place before the manifest, which is the last to."""
_log = logger(__name__)
_SAME = ("system_hash", "fmu_sha256", "settings")


def merge(folders: Sequence[Path | str], out: Path | str) -> Manifest:
    """Copy the shards of ``folders`` into the new dataset ``out``; every system keeps its seed, index and split.

    Raises
    ------
    DatasetError
        If two have a root seed in common, differ in system, FMU, schema or settings, if a shard is damaged or not in
        its manifest, if a run is at work in one of them, or if ``out`` holds anything or cannot be written. Then
        ``out`` is as it was.
    """
    for folder in folders:  # before their manifests are read
        if holder := at_work(folder):
            raise DatasetError(f"{folder}: a run is at it ({holder}); expected a dataset that nobody writes to")
    datasets = [DatasetFolder(folder) for folder in folders]
    if len(datasets) < 2:
        raise DatasetError(f"{len(datasets)} dataset to merge; expected at least two")
    sources = _check(datasets)
    target = Path(out)
    if target.exists() and (not target.is_dir() or {*target.iterdir()} - {target / _DRAFT, *_moved(target)}):
        raise DatasetError(f"{target}: already there; expected a new folder")
    first = datasets[0].manifest
    try:
        with _whole(target) as draft:
            (draft / "shards").mkdir()
            entries = [_copy(dataset, entry, draft) for dataset in datasets for entry in dataset.manifest.shards]
            failures = Failures(one for dataset in datasets for one in Failures.read(dataset.folder))
            failures.write(draft)
            _limits(datasets, draft)
            changes = {"shards": entries, "sources": sources, "stages": []}
            merged = first.model_copy(update={**changes, "systems": sum(one.systems for one in sources)})
            for dataset in datasets[1:]:
                for versions in dataset.manifest.all_versions():
                    note(merged, versions, datasets[0].folder, str(dataset.folder))
            write_card(draft, merged, datasets[0].system)
            write_manifest(draft, merged)
    except OSError as error:
        # of a copy the second is what was written; what lay in the draft is gone
        found = Path(str(error.filename2 or error.filename or target))
        where = found if any(found.is_relative_to(one.folder) for one in datasets) else target
        raise DatasetError(
            f"{where}: cannot be read or written: {error.strerror or error}; nothing was merged, nothing is left of it"
        ) from None
    return merged


@contextmanager
def _whole(target: Path) -> Iterator[Path]:
    """A folder to make the dataset in, which becomes ``target`` when all is in it and is removed otherwise.

    Half a dataset without a manifest would pass for a run that was stopped early, and bar the way of the next merge.
    """
    there = target.is_dir()  # what is above it may be another file system then, or another user's
    draft = target / _DRAFT if there else temporary_name(target)
    draft.parent.mkdir(parents=True, exist_ok=True)
    if found := at_work(draft):
        raise DatasetError(f"{target}: another merge is at it ({found}); expected a new folder")
    if there:
        _remove(_moved(target))
    shutil.rmtree(draft, ignore_errors=True)  # of a process that was killed
    draft.mkdir()  # not of tempfile, whose folders nobody else may read
    try:
        if not there:
            yield draft
            draft.rename(target)
            return
        with FolderLock(draft):
            yield draft
            made = [path for path in draft.iterdir() if path.name != LOCK_FILE]
            try:
                for path in sorted(made, key=lambda one: one.name == MANIFEST):  # a reader looks for that
                    path.rename(target / path.name)
            except BaseException:
                _remove(_moved(target))
                raise
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _moved(target: Path) -> list[Path]:
    """What a merge that did not come to its end had moved out of its draft, which was whole then.

    The folder was empty before, and whoever else looks for one refuses it with a draft in it.
    """
    if (target / MANIFEST).exists() or not (target / _DRAFT / MANIFEST).exists():
        return []
    draft = target / _DRAFT
    return [path for path in target.iterdir() if path.name in _MADE and not (draft / path.name).exists()]


def _remove(paths: list[Path]) -> None:
    for path in paths:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()


def _check(datasets: Sequence[DatasetFolder]) -> list[Source]:
    """Refuse datasets that do not belong together; returns what the merged one consists of."""
    first = datasets[0]
    owners: dict[int, Path] = {}
    sources: list[Source] = []
    for dataset in datasets:
        manifest = dataset.manifest
        facts = [{field: getattr(one, field) for field in _SAME} for one in (first.manifest, manifest)]
        for one, fact in zip((first.manifest, manifest), facts, strict=True):
            fact["schema"] = one.schema_version.partition(".")[0]  # minor versions have the same values
        for field in facts[0]:
            ours, theirs = facts[0][field], facts[1][field]
            if ours != theirs:
                raise DatasetError(
                    f"{dataset.folder}: {field} is {theirs}, {first.folder} has {ours}; only datasets of one system, "
                    "FMU, schema and experiment can be merged"
                )
        for source in manifest.sources or [Source(root_seed=manifest.root_seed, systems=manifest.systems)]:
            if source.root_seed in owners:
                raise DatasetError(
                    f"{dataset.folder}: its root seed {source.root_seed} is also that of {owners[source.root_seed]}, "
                    "so they hold the same systems; expected different root seeds"
                )
            owners[source.root_seed] = dataset.folder
            sources.append(source)
        _check_whole(dataset)
    return sources


def _check_whole(dataset: DatasetFolder) -> None:
    """Refuse a dataset with shards that its manifest does not list; say what else it lacks."""
    manifest = dataset.manifest
    listed = {entry.file for entry in manifest.shards}
    for path in sorted((dataset.folder / "shards").glob("*.nc")):
        if path.name not in listed:
            raise DatasetError(
                f"{path}: not in the manifest; expected shards that are: run again to go on with a run that was "
                "stopped, or remove the file"
            )
    if (left := lacking(dataset)) > 0:
        _log.warning(
            "%s: %d of its %d systems have not been simulated, and are not in what is merged",
            *(dataset.folder, left, manifest.systems),
        )


def _limits(datasets: Sequence[DatasetFolder], draft: Path) -> None:
    """What is known of the limit in any of the datasets; of the same condition and season the first one's counts.

    Limits of another system or FMU, or of other channels, are left out, as the header that stands over all of
    them would pass them off as this system's.
    """
    known: list[Ceilings] = []
    for one in datasets:
        path = one.folder / CEILING_FILE
        if not path.exists():
            continue
        found = read_ceilings(path)
        if (found.system_hash, found.fmu_sha256) != (one.manifest.system_hash, one.manifest.fmu_sha256):
            _log.warning("%s: not merged: its limits are of another system or FMU than the dataset", path)
        elif known and (found.outputs, found.nuisances) != (known[0].outputs, known[0].nuisances):
            _log.warning("%s: not merged: its limits are of other channels than those before it", path)
        else:
            known.append(found)
    if not known:
        return
    joined = known[0].model_copy(update={"ceilings": []})
    for ceiling in [ceiling for one in reversed(known) for ceiling in one.ceilings]:
        joined.put(ceiling)
    write_ceilings(draft / CEILING_FILE, joined)


def _copy(dataset: DatasetFolder, entry: ShardEntry, target: Path) -> ShardEntry:
    seed = dataset.manifest.seed_of(entry)
    plain = re.sub(r"^seed-\d+-", "", entry.file)
    name = f"seed-{seed}-{plain}"
    origin, goal = dataset.shard_path(entry), target / "shards" / name
    if not origin.exists():
        raise DatasetError(f"{origin}: the manifest lists this shard, but it is missing")
    temporary = temporary_name(goal)
    shutil.copyfile(origin, temporary)
    if sha256_of(temporary) != entry.sha256:
        temporary.unlink()
        raise DatasetError(f"{origin}: not what its manifest says; `datagen verify --repair` first")
    temporary.replace(goal)
    return entry.model_copy(update={"file": name, "root_seed": seed})
