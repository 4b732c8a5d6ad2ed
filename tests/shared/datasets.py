"""Datasets of random numbers for the default room's description."""

from pathlib import Path

import numpy as np

from shared.schema import build_shard
from shared.store import Manifest, write_manifest, write_shard
from shared.system import load_system


def make_shard(indices, seed=3, count=48):
    """So many hours of systems with these indices."""
    system, rng = load_system("MixedAirCO2"), np.random.default_rng([seed, indices[0]])
    size = len(indices)
    return build_shard(
        system,
        indices=np.array(indices),
        root_seed=seed,
        parameters=rng.random((size, len(system.parameters))),
        outputs=rng.random((size, len(system.outputs), count)),
        inputs=rng.random((size, len(system.inputs), count)),
        attributes={"fmu_sha256": "0" * 64, "root_seed": f"{seed}"},
    )


def write_dataset(folder: Path, blocks, seed=3, **facts):
    """A dataset with these systems in its shards."""
    (folder / "shards").mkdir(parents=True)
    system, entries = load_system("MixedAirCO2"), []
    for number, indices in enumerate(blocks):
        path = folder / "shards" / f"shard-{number:06d}.nc"
        entries.append(write_shard(path, make_shard(indices, seed), indices))
    facts = {"system_name": system.name, "system_hash": system.hash(), "system": system.canonical()} | facts
    facts |= {"fmu_sha256": "0" * 64, "root_seed": seed, "shards": entries}
    write_manifest(folder, Manifest(**facts))
    return folder
