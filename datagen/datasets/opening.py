"""A whole dataset as one lazy xarray Dataset: :func:`open`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import dask
import dask.array
import numpy as np
import xarray as xr

from shared.errors import DatasetError
from shared.netcdf import read_netcdf
from shared.schema import SPLITS, split_of
from shared.store import DatasetFolder, ShardEntry


def open(folder: Path | str) -> xr.Dataset:
    """A dataset of any size as one Dataset over (system, time), read from its shards when values are asked for.

    Parameters
    ----------
    folder
        A dataset made by `datagen run`, or its URL.

    Returns
    -------
    Dataset
        Parameters over (system), outputs and inputs over (system, time), all in chunks of a shard (dask), with the
        units and CF attributes of the shards. Coordinates are ``system`` (index), ``root_seed``, ``split``
        (``train``, ``validation``, ``test``) and ``time``. A shard is read only if it has the hash of the manifest.
        The functions of `trainer` take such a Dataset in place of its folder.

    Raises
    ------
    DatasetError
        If the folder holds no readable dataset, or no shard yet; when values are read, if a shard is damaged.

    Examples
    --------
    >>> import datagen
    >>> data = datagen.open("data")  # doctest: +SKIP
    >>> data.where(data.split == "test", drop=True).mean("time")  # doctest: +SKIP
    """
    dataset = DatasetFolder(folder)
    entries = dataset.manifest.shards
    if not entries:
        raise DatasetError(f"{folder}: the dataset has no shards yet; expected a finished `datagen run`")
    first = read_netcdf(dataset.shard_path(entries[0]), DatasetError, "a shard made by `datagen run`", times=None)
    systems = [(dataset.manifest.seed_of(entry), index) for entry in entries for index in entry.systems]
    variables: dict[str, xr.Variable] = {}
    for name, one in first.variables.items():
        if one.dims[:1] != ("system",):
            variables[str(name)] = one
        elif name not in ("system", "split"):
            parts = [_part(dataset, entry, str(name), one) for entry in entries]
            variables[str(name)] = xr.Variable(one.dims, dask.array.concatenate(parts), one.attrs)
    coordinates: dict[str, Any] = {
        "system": ("system", np.array([index for _, index in systems], dtype=np.int64), first["system"].attrs),
        "root_seed": ("system", [seed for seed, _ in systems]),
        "split": ("system", np.array([SPLITS[split_of(seed, index)] for seed, index in systems])),
    }
    made = xr.Dataset(variables, coordinates, first.attrs)
    made = xr.decode_cf(made.set_coords("time"), decode_times=xr.coders.CFDatetimeCoder(), decode_timedelta=False)
    made.encoding["source"] = str(dataset.folder)
    return made


def _part(dataset: DatasetFolder, entry: ShardEntry, name: str, like: xr.Variable) -> dask.array.Array:
    """A variable of one shard, read when it is wanted."""
    shape = (len(entry.systems), *like.shape[1:])
    values = dask.delayed(dataset.values, pure=False)(entry, name)
    return dask.array.from_delayed(values, shape, like.dtype)
