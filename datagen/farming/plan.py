"""Which systems go into which shard, and which shards a dataset still lacks.

The plan follows from the manifest alone. Systems that were added later (``--extend``) start a new shard, so that a
shard, once written, never changes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from datagen.farming.failures import Failures
from shared.errors import DatasetError
from shared.netcdf import MOST
from shared.reading import MIB
from shared.schema import CONTENT_HASH, split_of
from shared.store import DatasetFolder, Manifest, ShardEntry, sha256_of
from shared.system import System

_MOST_SYSTEMS = 2**63 - 1
"""What the manifest and a shard's int64 hold."""


@dataclass(frozen=True)
class Piece:
    """One shard of the plan: its file, its systems, their root seed."""

    file: str
    systems: range | tuple[int, ...]
    root_seed: int


def check_sizes(system: System, systems: int, shard_size: int) -> None:
    """Refuse a plan that no manifest can hold, or shards that no reader takes.

    Raises DatasetError if there are no systems or too many, or a shard holds more numbers than
    :data:`shared.netcdf.MOST`.
    """
    for name, count in (("systems", systems), ("shard_size", shard_size)):
        if not 1 <= count <= _MOST_SYSTEMS:
            raise DatasetError(
                f"{name} is {count}; expected at least 1{'' if count < 1 else f', at most {_MOST_SYSTEMS}'}"
            )
    steps = round(system.experiment.hours * 3600 / system.experiment.step)
    channels, largest = len(system.inputs) + len(system.outputs), min(systems, shard_size)
    each = len(system.parameters) + len(system.uncertain) + len(system.told) + 4  # and its index, start, split, effects
    size = steps * (4 * channels * largest + 24) + 8 * each * largest  # float32, and float64 for all but series
    if size > MOST:
        raise DatasetError(
            f"shard_size is {shard_size}: {largest} systems with {channels} channels of {steps} steps are"
            f" {size / MIB:.0f} MiB; expected at most {MOST / MIB:.0f}, more of which no reader takes in one file"
        )


def pieces(manifest: Manifest) -> Iterator[Piece]:
    """All shards of a dataset, written or not."""
    number, first = 0, 0
    for stop in manifest.stages or [manifest.systems]:
        for start in range(first, stop, manifest.shard_size):
            systems = range(start, min(start + manifest.shard_size, stop))
            yield Piece(f"shard-{number:06d}.nc", systems, manifest.root_seed)
            number += 1
        first = stop


def missing(manifest: Manifest, failures: Failures, *, retry: bool = False) -> Iterator[Piece]:
    """Shards still to be simulated; with ``retry`` also those in which a system failed."""
    have = {entry.file for entry in manifest.shards}
    for piece in pieces(manifest):
        failed = sum((piece.root_seed, index) in failures for index in piece.systems) if len(failures) else 0
        given_up = failed == len(piece.systems)
        if (retry and failed) or (piece.file not in have and not given_up):
            yield piece


def settings_text(manifest: Manifest) -> str:
    """A dataset's settings as each of its shards carries them."""
    return json.dumps(manifest.settings, sort_keys=True)


def adopt(folder: Path, manifest: Manifest, failures: Failures, settings: str) -> list[ShardEntry]:
    """Entries for shards that were written whole, but not yet recorded, when a run was stopped.

    Such a file must be of this very dataset and agree with the content hash that it carries; any other is left where
    it is, and the run writes over it. Systems in it that had failed before are failures no longer: a run was stopped
    between the two.
    """
    have = {entry.file for entry in manifest.shards}
    present = {path.name for path in (folder / "shards").glob("*.nc")} - have
    if not present:
        return []
    dataset = DatasetFolder(folder)
    found, again = [], 0
    for piece in pieces(manifest):
        if piece.file in present:
            entry = ShardEntry(file=piece.file, systems=[], sha256="", content_hash="")
            try:
                digest, facts = dataset.shard_facts(entry)
            except DatasetError:
                continue
            held = facts["systems"] if isinstance(facts["systems"], list) else []
            wanted = [i for i in piece.systems if (piece.root_seed, i) not in failures or i in held]
            expected = {
                CONTENT_HASH: digest,
                "fmu_sha256": manifest.fmu_sha256,
                "root_seed": str(manifest.root_seed),
                "settings": settings,
                "systems": wanted,
                "splits": [split_of(manifest.root_seed, i) for i in wanted],
            }
            if all(facts.get(name) == value for name, value in expected.items()):
                sha256 = sha256_of(dataset.shard_path(entry))
                found.append(entry.model_copy(update={"systems": wanted, "sha256": sha256, "content_hash": digest}))
                again += failures.drop(piece.root_seed, wanted)
    if again:
        failures.write(folder)
    return found
