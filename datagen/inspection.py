"""Looking at a dataset: what it is (``info``), and whether its files are what its manifest says (``verify``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from shared.errors import DatasetError
from shared.schema import SPLITS, split_of
from shared.store import DatasetFolder, sha256_of


def info(folder: Path | str) -> dict[str, Any]:
    """What a dataset holds, from its manifest.

    Raises
    ------
    DatasetError
        If there is no readable manifest.
    """
    dataset = DatasetFolder(folder)
    manifest = dataset.manifest
    indices = [i for entry in manifest.shards for i in entry.systems]
    splits = [split_of(manifest.root_seed, i) for i in indices]
    size = sum(dataset.shard_path(e).stat().st_size for e in manifest.shards if dataset.shard_path(e).exists())
    return {
        "folder": str(folder),
        "system": manifest.system_name,
        "system_hash": manifest.system_hash,
        "fmu_sha256": manifest.fmu_sha256,
        "schema_version": manifest.schema_version,
        "root_seed": manifest.root_seed,
        "systems_wanted": manifest.systems,
        "systems_done": len(indices),
        "complete": len(manifest.shards) == -(-manifest.systems // manifest.shard_size),
        "splits": {name: splits.count(k) for k, name in enumerate(SPLITS)},
        "shards": len(manifest.shards),
        "bytes": size,
        "settings": manifest.settings,
        "parameters": dataset.system.parameter_names,
        "outputs": dataset.system.output_names,
        "inputs": dataset.system.input_names,
        "versions": manifest.versions,
    }


def verify(folder: Path | str) -> list[str]:
    """Hold every shard against the manifest; returns one sentence per fault, none if all is well.

    Raises
    ------
    DatasetError
        If the manifest itself cannot be read.
    """
    dataset = DatasetFolder(folder)
    faults: list[str] = []
    seen: set[int] = set()
    for entry in dataset.manifest.shards:
        path = dataset.shard_path(entry)
        for index in entry.systems:
            if index in seen:
                faults.append(f"{path}: system {index} is in two shards")
            seen.add(index)
        try:
            if not path.exists():
                raise DatasetError(f"{path}: the manifest lists this shard, but it is missing")
            if dataset.shard_content_hash(entry) != entry.content_hash:
                faults.append(f"{path}: its content is not what the manifest says; it was changed or damaged")
            elif sha256_of(path) != entry.sha256:
                faults.append(f"{path}: same content, but the file was rewritten (sha256 differs)")
        except DatasetError as error:
            faults.append(str(error))
    listed = {entry.file for entry in dataset.manifest.shards}
    faults += [
        f"{path}: not in the manifest"
        for path in sorted((dataset.folder / "shards").glob("*.nc"))
        if path.name not in listed
    ]
    return faults
