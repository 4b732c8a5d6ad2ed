"""What a dataset's ``manifest.json`` says, as models; how it is read, and how files are written whole."""

from __future__ import annotations

import hashlib
import os
import socket
from pathlib import Path
from typing import Annotated, Any

import xarray as xr
from pydantic import BaseModel, Field

from shared.errors import DatasetError
from shared.reading import MIB, parse_json, read_text, validated
from shared.results import Result
from shared.schema import SCHEMA_VERSION, SPLITS, check_version, split_of

MANIFEST = "manifest.json"
"""In a dataset's folder; it is what makes it one."""
MOST_MANIFEST = 4096 * MIB
"""Bytes; a manifest has about 500 for each shard."""

Index = Annotated[int, Field(ge=0, lt=2**63)]
"""Of a system: what an int64 holds."""


class ShardEntry(BaseModel, extra="ignore"):
    """What the manifest knows of one shard; ``root_seed`` only where it is not the dataset's (merged datasets)."""

    file: str
    systems: list[Index]
    sha256: str
    content_hash: str
    root_seed: int | None = Field(None, ge=0)


class Source(BaseModel):
    """One of the datasets that a merged dataset came from."""

    root_seed: int
    systems: int


class Manifest(Result, BaseModel):
    """What a dataset is, and which shards it has.

    ``stages`` are the numbers of systems asked for one after another, if the dataset was extended; ``sources`` the
    datasets it was merged from, if it was. ``versions`` are those that the dataset was begun with, ``other_versions``
    those of later runs and of merged datasets, where other ones took part in its numbers.
    """

    schema_version: str = SCHEMA_VERSION
    system_name: str
    system_hash: str
    system: str = Field(description="the system description as canonical JSON")
    fmu_sha256: str
    root_seed: int = Field(ge=0)
    systems: int = Field(ge=0, lt=2**63, description="systems asked for")
    shard_size: int = Field(gt=0, lt=2**63)
    settings: dict[str, Any] = {}
    versions: dict[str, str] = {}
    other_versions: list[dict[str, str]] = []
    stages: list[int] = []
    sources: list[Source] = []
    shards: list[ShardEntry] = []

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        done = sum(len(entry.systems) for entry in self.shards)
        return f"{self.system_name}, {done} of {self.systems} systems in {len(self.shards)} shards"

    def to_dataframe(self) -> Any:
        """A row for each system that is done: its root seed, index and split, and the shard that it is in."""
        rows = [(self.seed_of(entry), index, entry.file) for entry in self.shards for index in entry.systems]
        columns = {
            "root_seed": ("row", [seed for seed, _, _ in rows]),
            "system": ("row", [index for _, index, _ in rows]),
            "split": ("row", [SPLITS[split_of(seed, index)] for seed, index, _ in rows]),
            "shard": ("row", [file for _, _, file in rows]),
        }
        return xr.Dataset(columns).to_dataframe()

    def all_versions(self) -> list[dict[str, str]]:
        """Every set of versions that took part in the numbers; the first is that which the dataset was begun with."""
        return [self.versions, *self.other_versions]

    def seed_of(self, entry: ShardEntry) -> int:
        """Root seed of a shard's systems."""
        return self.root_seed if entry.root_seed is None else entry.root_seed

    def done(self) -> list[tuple[int, int]]:
        """Root seed and index of every system that is in a shard."""
        return [(self.seed_of(entry), index) for entry in self.shards for index in entry.systems]


def temporary_name(path: Path) -> Path:
    """A neighbour of ``path`` that no other process on any machine writes to."""
    return path.with_name(f".{path.name}.{socket.gethostname()}.{os.getpid()}.tmp")


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file whole: temporary neighbour, flush, rename."""
    temporary = temporary_name(path)
    try:
        with open(temporary, "wb") as handle:
            handle.write(data)
            handle.flush()
            os.fsync(handle.fileno())
        os.replace(temporary, path)
    except OSError as error:
        if error.filename is None:  # a full disk names none
            error.filename = str(path)
        raise
    finally:
        temporary.unlink(missing_ok=True)


def sha256_of(path: Path) -> str:
    """sha256 of a file."""
    with open(path, "rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write ``manifest.json``."""
    write_atomically(folder / MANIFEST, (manifest.model_dump_json(indent=1) + "\n").encode())


def read_manifest(folder: Path | str) -> Manifest:
    """Read and check ``manifest.json``.

    Raises DatasetError if it is missing, damaged, or of a newer schema.
    """
    path = Path(folder) / MANIFEST
    if Path(folder).is_file():
        raise DatasetError(f"{folder}: is a file; expected the folder of a dataset made by `datagen run`")
    text = read_text(path, DatasetError, "a dataset made by `datagen run`", most=MOST_MANIFEST)
    return parse_manifest(text, f"{path}")


def parse_manifest(text: str, where: str) -> Manifest:
    """Check the text of a manifest; ``where`` is what the error names.

    Raises DatasetError if it is damaged, or of a newer schema.
    """
    raw = parse_json(text, where, DatasetError, "a dataset made by `datagen run`")
    if not isinstance(raw, dict) or "schema_version" not in raw:
        raise DatasetError(f"{where}: schema_version is missing; expected a manifest made by `datagen run`")
    check_version(raw["schema_version"], where)
    return validated(Manifest, raw, where, DatasetError)


def check_shard_name(entry: ShardEntry, where: str) -> None:
    """Refuse a shard whose name leaves the folder: a DatasetError that names it and ``where`` its dataset is."""
    if Path(entry.file).name != entry.file or entry.file in ("", "..") or "\0" in entry.file:
        raise DatasetError(f"{where}: shard {entry.file!r} is not a plain file name")
