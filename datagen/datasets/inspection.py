"""Looking at a dataset: what it is (``info``), and whether its files are what its manifest says (``verify``)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from datagen.farming.failures import Failures
from datagen.farming.plan import settings_text
from shared.errors import DatasetError
from shared.logs import logger
from shared.progress import tracked
from shared.reading import read_text
from shared.results import Result
from shared.schema import SPLITS, split_of
from shared.store import MANIFEST, DatasetFolder, ShardEntry, sha256_of

_log = logger(__name__)


@dataclass(frozen=True)
class Fault:
    """Something wrong with a dataset; ``entry`` is the shard to simulate again, if that would mend it."""

    text: str
    entry: ShardEntry | None = None


@dataclass(frozen=True, repr=False)
class Info(Result):
    """What a dataset holds; ``bytes`` are those of its shards."""

    folder: str
    system: str
    system_hash: str
    fmu_sha256: str
    schema_version: str
    root_seed: int
    root_seeds: list[int]
    systems_wanted: int
    systems_done: int
    systems_failed: int
    complete: bool
    splits: dict[str, int]
    shards: int
    bytes: int
    settings: dict[str, Any]
    parameters: list[str]
    outputs: list[str]
    inputs: list[str]
    versions: dict[str, str]
    other_versions: list[dict[str, str]]

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        return f"{self.folder}: {self.system}, {self.systems_done} of {self.systems_wanted} systems"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each fact."""
        return pd.DataFrame({"value": vars(self)}).rename_axis("fact")


def info(folder: Path | str) -> Info:
    """What a dataset holds, from its manifest.

    Raises
    ------
    DatasetError
        If there is no readable manifest.
    """
    dataset = DatasetFolder(folder)
    manifest = dataset.manifest
    done = manifest.done()
    splits = [split_of(seed, index) for seed, index in done]
    failures = Failures.read(dataset.folder)
    size = sum(dataset.shard_path(e).stat().st_size for e in manifest.shards if dataset.shard_path(e).exists())
    return Info(
        folder=str(folder),
        system=manifest.system_name,
        system_hash=manifest.system_hash,
        fmu_sha256=manifest.fmu_sha256,
        schema_version=manifest.schema_version,
        root_seed=manifest.root_seed,
        root_seeds=[source.root_seed for source in manifest.sources] or [manifest.root_seed],
        systems_wanted=manifest.systems,
        systems_done=len(done),
        systems_failed=len(failures),
        complete=len(done) == manifest.systems,
        splits={name: splits.count(k) for k, name in enumerate(SPLITS)},
        shards=len(manifest.shards),
        bytes=size,
        settings=manifest.settings,
        parameters=dataset.system.parameter_names,
        outputs=dataset.system.output_names,
        inputs=dataset.system.input_names,
        versions=manifest.versions,
        other_versions=manifest.other_versions,
    )


def verify(folder: Path | str, *, quiet: bool = True) -> list[str]:
    """Hold a dataset against its manifest; returns one sentence per fault, none if all is well.

    Raises
    ------
    DatasetError
        If the manifest itself cannot be read.
    """
    return [fault.text for fault in find_faults(DatasetFolder(folder), quiet=quiet)]


def find_faults(dataset: DatasetFolder, *, quiet: bool = True) -> list[Fault]:
    """What :func:`verify` says, with the shards concerned."""
    faults: list[Fault] = []
    seen: set[tuple[int, int]] = set()
    for entry in tracked(dataset.manifest.shards, "shards", shown=not quiet):
        path = dataset.shard_path(entry)
        seed = dataset.manifest.seed_of(entry)
        twice = [index for index in entry.systems if (seed, index) in seen]
        faults += [Fault(f"{path}: system {index} is in two shards") for index in twice]
        seen |= {(seed, index) for index in entry.systems}
        try:
            _check_shard(dataset, entry)
        except DatasetError as error:
            faults.append(Fault(str(error), entry))
    listed = {entry.file for entry in dataset.manifest.shards}
    faults += [
        Fault(f"{path}: not in the manifest; a resumed run adopts it or writes over it")
        for path in sorted((dataset.folder / "shards").glob("*.nc"))
        if path.name not in listed
    ]
    faults += _check_rest(dataset, seen)
    _tell_lacking(dataset)
    return faults


def lacking(dataset: DatasetFolder) -> int:
    """How many systems that a dataset shall have are neither in a shard nor among the failures.

    Raises DatasetError if the list of failures cannot be read.
    """
    manifest = dataset.manifest
    return manifest.systems - len(manifest.done()) - len(Failures.read(dataset.folder))


def _tell_lacking(dataset: DatasetFolder) -> None:
    """Say how many systems are neither in a shard nor among the failures: a run goes on, or a list was lost."""
    with suppress(DatasetError):  # of failures that cannot be read, which are a fault of their own
        if (left := lacking(dataset)) > 0:
            _log.warning(
                "%s: %d of its %d systems are neither in a shard nor in failures.jsonl: its run was stopped or is not"
                " over, or the list was changed",
                *(dataset.folder, left, dataset.manifest.systems),
            )


def _check_shard(dataset: DatasetFolder, entry: ShardEntry) -> None:
    """Raise a sentence if a shard is not what the manifest says, or does not follow the schema."""
    path, manifest = dataset.shard_path(entry), dataset.manifest
    seed = manifest.seed_of(entry)
    if not path.exists():
        raise DatasetError(f"{path}: the manifest lists this shard, but it is missing")
    digest, facts = dataset.shard_facts(entry)
    if digest != entry.content_hash:
        raise DatasetError(f"{path}: its content is not what the manifest says; it was changed or damaged")
    if sha256_of(path) != entry.sha256:
        raise DatasetError(f"{path}: same content, but the file was rewritten (sha256 differs)")
    experiment = dataset.system.experiment
    expected = {
        "systems": entry.systems,
        "splits": [split_of(seed, index) for index in entry.systems],
        "steps": round(experiment.hours * 3600 / experiment.step),
        "fmu_sha256": manifest.fmu_sha256,
    }
    if "settings" in facts:  # shards of the first versions carry none
        expected["settings"] = settings_text(manifest)
    for name, value in expected.items():
        if facts.get(name) != value:
            raise DatasetError(f"{path}: {name} is {facts.get(name)}; the manifest says {value}")


def _check_rest(dataset: DatasetFolder, done: set[tuple[int, int]]) -> list[Fault]:
    """Faults of the card, of the list of failures and of what the manifest says twice."""
    faults = []
    manifest = dataset.manifest
    for name, value in dataset.system.experiment.model_dump(mode="json").items():
        if manifest.settings.get(name, value) != value:
            faults.append(
                Fault(
                    f"{dataset.folder / MANIFEST}: {name} is {manifest.settings[name]} in its settings, and in its"
                    f" system {value}; expected the same"
                )
            )
    card = dataset.folder / "README.md"
    if dataset.manifest.shards and not card.exists():
        faults.append(Fault(f"{card}: missing; `datagen run` and `datagen verify --repair` write it"))
    try:
        text = read_text(card, DatasetError, "the dataset's card") if card.exists() else None
        if text is not None and dataset.manifest.system_hash[:16] not in text:
            faults.append(Fault(f"{card}: not the card of this dataset"))
        failures = Failures.read(dataset.folder)
    except DatasetError as error:
        return [*faults, Fault(str(error))]
    both = [one for one in failures if (one["root_seed"], one["system"]) in done]
    faults += [Fault(f"{dataset.folder}: system {one['system']} is in a shard and in failures.jsonl") for one in both]
    return faults
