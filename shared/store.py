"""The dataset on disk: ``manifest.json``, ``shards/*.nc``, ``failures.jsonl``, ``README.md``.

The manifest is the dataset's word: a shard that it does not list is not there. Everything is written to a temporary
file, flushed and renamed, so that a reader sees a file whole or not at all.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr
from xarray.backends.locks import HDF5_LOCK, NETCDFC_LOCK, combine_locks

from shared.errors import DatasetError, SystemDescriptionError
from shared.manifest import MANIFEST as MANIFEST
from shared.manifest import MOST_MANIFEST as MOST_MANIFEST
from shared.manifest import Manifest as Manifest
from shared.manifest import ShardEntry as ShardEntry
from shared.manifest import Source as Source
from shared.manifest import check_shard_name as check_shard_name
from shared.manifest import parse_manifest as parse_manifest
from shared.manifest import read_manifest as read_manifest
from shared.manifest import sha256_of as sha256_of
from shared.manifest import temporary_name as temporary_name
from shared.manifest import write_atomically as write_atomically
from shared.manifest import write_manifest as write_manifest
from shared.netcdf import read_netcdf, write_netcdf
from shared.netcdf_child import check_declared
from shared.places import is_url
from shared.reading import read_bytes, why
from shared.schema import CONTENT_HASH, DISTURBANCES, SPLITS, check_version, dataset_hash, newer_minor
from shared.system import System, system_from_canonical

_LARGEST = 1 << 40
"""Bytes of a shard: memory is the limit."""


def write_shard(
    path: Path, dataset: xr.Dataset, systems: list[int], *, before: Callable[[], None] = lambda: None
) -> ShardEntry:
    """Write a shard, or the record of one system, whole, and return its manifest entry.

    The content hash is also written into the file, so that a shard can be held against itself. ``before`` is called
    when all is written and the file is about to get its name; where it raises, the file gets none.

    Raises
    ------
    OSError
        If it cannot be written; then nothing has changed on the disk.
    """
    digest_of_content = dataset_hash(dataset)
    dataset = dataset.assign_attrs({CONTENT_HASH: digest_of_content})
    temporary = temporary_name(path)
    encoding: dict[Any, dict[str, Any]] = {
        name: {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": (1,) * (v.ndim - 1) + v.shape[-1:]}
        for name, v in dataset.data_vars.items()
        if v.dims[-1:] == ("time",)
    }
    for name in dataset.variables:
        encoding.setdefault(name, {})["_FillValue"] = None
    try:
        write_netcdf(dataset, temporary, encoding)
        digest = sha256_of(temporary)
        before()
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return ShardEntry(file=path.name, systems=systems, sha256=digest, content_hash=digest_of_content)


@dataclass(frozen=True)
class Records:
    """Series and parameters of many systems.

    ``values`` float32 (systems, channels, time) [units of the channels], ``parameters`` float64
    (systems, parameters), ``systems`` int64 (systems,), ``splits`` int8 (systems,), ``time`` (time,) [s], ``seeds``
    (systems,) root seeds as Python integers: a system is known by its root seed and its index. ``starts`` (systems,)
    [s since time zero]: when each record begins; ``time`` runs from there. ``given`` float64 (systems, facts): the
    given facts that the description tells, in its order [unit of each]. ``disturbances`` (systems,): how many effects
    act on each.
    """

    channels: list[str]
    values: np.ndarray
    parameters: np.ndarray
    systems: np.ndarray
    splits: np.ndarray
    time: np.ndarray
    seeds: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=object))
    starts: np.ndarray = field(default_factory=lambda: np.empty(0))
    given: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    disturbances: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int8))

    def of_split(self, split: str) -> np.ndarray:
        """Rows of a split, by its name (``train``, ``validation``, ``test``)."""
        return np.flatnonzero(self.splits == SPLITS.index(split))


_WRONG = (ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError, TypeError, ValueError)
"""What netCDF4 and numpy raise over a file that is not what it should be."""
_ALONE = combine_locks([NETCDFC_LOCK, HDF5_LOCK])
"""The C libraries crash where two threads use them: these are the locks that xarray takes for its own reads."""
_UNDAMAGED = "though its sha256 is the manifest's; expected a shard made by `datagen run`"


def _finite(shard: netCDF4.Dataset, name: str) -> np.ndarray:
    values: np.ndarray = shard[name][...]
    if not np.isfinite(values).all():
        raise ValueError(f"{name} has values that are not finite")
    return values


def _folder_of(data: xr.Dataset) -> Path:
    """Where a Dataset of `datagen.open` came from."""
    source = data.encoding.get("source")
    if not source or not Path(source).is_dir():
        raise DatasetError(
            "the Dataset in memory does not say which dataset it is; expected one of `datagen.open`, all of it, or the"
            " folder of the dataset"
        )
    return Path(source)


class DatasetFolder:
    """A dataset, opened for reading.

    Parameters
    ----------
    folder
        Its folder, a URL, whose content is then read from a cache, or the whole of it as `datagen.open` has it.

    Raises
    ------
    DatasetError
        If the place holds no readable dataset or cannot be reached, or what is in memory is a part of one.
    """

    def __init__(self, folder: Path | str | xr.Dataset) -> None:
        if isinstance(folder, xr.Dataset):
            self.folder = _folder_of(folder)
        elif is_url(folder):
            from shared.remote import cached  # which stands on this module

            self.folder = cached(folder)
        else:
            self.folder = Path(folder)
        self.manifest = read_manifest(self.folder)
        try:
            self.system: System = system_from_canonical(self.manifest.system, self.folder / MANIFEST)
        except SystemDescriptionError as error:
            if said := newer_minor(self.manifest.schema_version):  # which may describe more than this version knows
                raise DatasetError(f"{self.folder / MANIFEST}: {said}") from None
            raise error
        if self.system.hash() != self.manifest.system_hash:
            raise DatasetError(f"{self.folder / 'manifest.json'}: system and system_hash disagree; it was changed")

        if isinstance(folder, xr.Dataset) and folder.sizes.get("system") != len(self.manifest.done()):
            raise DatasetError(
                f"{self.folder}: the Dataset in memory has {folder.sizes.get('system', 0)} of its"
                f" {len(self.manifest.done())} systems; expected all of them, as `datagen.open` has them"
            )

    def values(self, entry: ShardEntry, name: str) -> np.ndarray:
        """A variable of a shard as it lies in the file; several threads may ask at once.

        Raises
        ------
        DatasetError
            If the shard is missing or damaged, or has no such variable.
        """
        with _ALONE, self._open(entry) as shard:
            try:
                return np.asarray(shard[name][...])
            except _WRONG as error:
                raise DatasetError(
                    f"{self.shard_path(entry)}: not as the manifest says ({why(error)}), {_UNDAMAGED}"
                ) from None

    def shard_path(self, entry: ShardEntry) -> Path:
        """Where a shard lies; a name that leaves the folder is refused."""
        check_shard_name(entry, f"{self.folder}")
        return self.folder / "shards" / entry.file

    def _open(self, entry: ShardEntry) -> netCDF4.Dataset:
        """A shard for reading; only one with the hash that the manifest gives meets the C libraries in this process."""
        path = self.shard_path(entry)
        if not path.exists():
            raise DatasetError(f"{path}: the manifest lists this shard, but it is missing")
        content = read_bytes(path, DatasetError, "a shard", most=_LARGEST)
        if hashlib.sha256(content).hexdigest() != entry.sha256:
            raise DatasetError(f"{path}: damaged or changed, its sha256 is not the manifest's; try `datagen verify`")
        try:
            shard = netCDF4.Dataset("shard", "r", memory=content)
            shard.set_auto_mask(False)
            facts = {name: shard.getncattr(name) for name in shard.ncattrs()}
            self._check_facts(path, facts)
            check_declared(shard.variables.values(), len(content))
        except _WRONG as error:
            raise DatasetError(f"{path}: cannot be read as NetCDF ({why(error)}), {_UNDAMAGED}") from None
        return shard

    def _check_facts(self, path: Path, facts: dict[str, Any]) -> None:
        check_version(facts.get("zeroshot_schema_version", "missing"), str(path))
        if facts.get("system_hash", "") != self.manifest.system_hash:
            raise DatasetError(f"{path}: belongs to another system than the manifest says")

    def shard_facts(self, entry: ShardEntry) -> tuple[str, dict[str, Any]]:
        """Content hash of a shard as it lies on disk, and what the file says of itself, read in a child process.

        The facts are the global attributes, ``systems``, ``splits`` and ``steps``.

        Raises
        ------
        DatasetError
            If the shard is missing, damaged or of another system.
        """
        path = self.shard_path(entry)
        shard = read_netcdf(path, DatasetError, "a shard made by `datagen run`", times=None)
        facts: dict[str, Any] = dict(shard.attrs)
        self._check_facts(path, facts)
        for name in ("system", "split", "time"):
            if name not in shard.variables:
                raise DatasetError(f"{path}: damaged (it has no variable {name!r})")
        facts |= {"systems": shard["system"].values.tolist(), "splits": shard["split"].values.tolist()}
        facts["steps"] = shard.sizes.get("time", 0)
        return dataset_hash(shard), facts

    def load(self, channels: list[str] | None = None, rows: np.ndarray | None = None) -> Records:
        """Read channels (outputs or inputs; the estimator's by default; none if empty) and parameters.

        Parameters
        ----------
        rows
            Systems to read, as rows of what is read without ``rows`` (all systems, by index), rising; all by default.
            Shards with none of them are not opened.

        Raises
        ------
        DatasetError
            If a channel is unknown, a shard is missing or damaged (it is named), or memory does not hold what is read.
        """
        wanted = list(self.system.estimator.channels if channels is None else channels)
        known = [*self.system.output_names, *self.system.input_names]
        for channel in wanted:
            if channel not in known:
                raise DatasetError(f"{self.folder}: no channel {channel!r}; found {', '.join(known)}")
        if not self.manifest.shards:
            raise DatasetError(f"{self.folder}: the dataset has no shards yet; expected a finished `datagen run`")
        listed = np.concatenate([np.array(entry.systems, dtype=np.int64) for entry in self.manifest.shards])
        order = np.argsort(listed, kind="stable")
        chosen = order if rows is None else order[rows]
        place = np.full(len(listed), -1)  # of each listed system in what is returned
        place[chosen] = np.arange(len(chosen))
        values = np.empty((0, 0, 0), dtype=np.float32)
        parameters = np.empty((len(chosen), len(self.system.parameters)))
        splits, starts = np.empty(len(chosen), dtype=np.int8), np.zeros(len(chosen))
        seeds = np.empty(len(chosen), dtype=object)
        given, disturbances = np.empty((len(chosen), len(self.system.told))), np.zeros(len(chosen), dtype=np.int8)
        time, end = np.empty(0), 0
        for entry in self.manifest.shards:
            begin, end = end, end + len(entry.systems)
            here = np.flatnonzero(place[begin:end] >= 0)
            to = place[begin:end][here]
            if not len(here):
                continue
            with self._open(entry) as shard:
                try:
                    if shard["system"][...].tolist() != entry.systems:
                        raise ValueError("its systems are not those that the manifest lists")
                    time = _finite(shard, "time")
                    if len(values) != len(chosen):  # filled in place: a second copy would double the memory
                        values = np.empty((len(chosen), len(wanted), len(time)), dtype=np.float32)
                    for k, name in enumerate(wanted):
                        values[to, k] = shard[name][...][here]
                    for k, name in enumerate(self.system.parameter_names):
                        parameters[to, k] = shard[name][...][here]
                    for k, fact in enumerate(self.system.told):
                        given[to, k] = _finite(shard, fact.name)[here]
                    if DISTURBANCES in shard.variables:
                        disturbances[to] = shard[DISTURBANCES][...][here]
                    splits[to] = shard["split"][...][here]
                    seeds[to] = self.manifest.seed_of(entry)
                    if "start" in shard.variables:
                        starts[to] = _finite(shard, "start")[here]
                except MemoryError as error:
                    size = f"{len(chosen)} systems x {len(wanted)} channels x {len(time)} samples"
                    raise DatasetError(
                        f"{self.folder}: not enough memory for {size} ({why(error)}); expected fewer systems"
                    ) from None
                except _WRONG as error:
                    raise DatasetError(
                        f"{self.shard_path(entry)}: not as the manifest says ({why(error)}), {_UNDAMAGED}"
                    ) from None
        who = (listed[chosen], splits, time, seeds, starts)
        return Records(wanted, values, parameters, *who, given, disturbances)
