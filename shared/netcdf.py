"""NetCDF: files from elsewhere, read by a child process, and our own, written.

The C libraries behind NetCDF trust a file: a flipped bit can make them crash, take all memory or never return. So a
file without a known hash never reaches them in this process.

They read a file's bytes: HDF5 would lock a file that it opens itself, which some file systems of clusters cannot do.
"""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from shared import LOCKING
from shared.children import command, environment
from shared.errors import ZeroshotError
from shared.places import no_text
from shared.reading import MIB, short, size_of, why

MOST = 2048 * MIB
"""Bytes that a file may hold."""
_SHOWN = 40
"""Characters of a file that is none of NetCDF."""
_PROBE = bytes(MIB)
"""Enough that what is left of a disk that was too full does not take it."""


def read_netcdf(path: Path, error: type[ZeroshotError], expected: str, *, times: bool | None = False) -> xr.Dataset:
    """The numeric variables of a NetCDF file, of any of its formats, and all attributes that are text or numbers.

    ``times`` says whether times are decoded as the CF conventions have it, as missing values, scales and offsets always
    are; None leaves all as it is in the file. Raises ``error`` if the file is missing, damaged, or larger than
    :data:`MOST`.
    """
    size = size_of(path, error, expected)
    seconds = 5 + size // (5 * MIB)  # of one core; a file that is read at all takes a small part of it
    words = command("shared.netcdf_child", str(path.resolve()), str(MOST), str(seconds))
    alone = environment() | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        child = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, env=alone, timeout=30 * seconds)
    except subprocess.TimeoutExpired:
        raise error(f"{path}: cannot be read as NetCDF (no end of it is found); expected {expected}") from None
    except ValueError:  # a path with a null character
        raise error(f"{path}: cannot be read as NetCDF (no file has such a name); expected {expected}") from None
    if child.returncode:
        cause = child.stderr.decode(errors="replace").strip().splitlines()
        said = short(cause[-1]) if child.returncode > 0 and cause else _ending(child.returncode)
        if child.returncode > 0 and (begin := _begin(path)) is not None:
            raise error(f"{path}: is no NetCDF file but begins with {begin!r}; expected {expected}") from None
        raise error(f"{path}: cannot be read as NetCDF ({said}); expected {expected}")
    try:
        raw = _dataset(child.stdout)
        return raw if times is None else xr.decode_cf(raw, decode_times=times, decode_timedelta=False).load()
    except Exception as cause:  # decoding follows the file's own attributes, and raises whatever it meets there
        raise error(f"{path}: cannot be read as NetCDF ({why(cause)}); expected {expected}") from None


def write_netcdf(dataset: xr.Dataset, path: Path, encoding: Mapping[Any, dict[str, Any]]) -> None:
    """Write a NetCDF-4 file and flush it to the disk; what is there after an error is to be removed.

    Raises OSError if it cannot be written, with the cause: of a full disk the C libraries say no more than "HDF error",
    of a lock that they do not get "Permission denied".
    """
    try:
        dataset.to_netcdf(path, engine="netcdf4", format="NETCDF4", encoding=encoding)
    except UnicodeEncodeError:
        raise OSError(errno.EILSEQ, no_text(f"{path}"), str(path)) from None
    except (OSError, RuntimeError) as error:
        with open(path, "ab") as handle:  # it raises what the libraries did not say
            handle.write(_PROBE)
            handle.flush()
            os.fsync(handle.fileno())
        if isinstance(error, PermissionError):
            raise OSError(errno.ENOLCK, f"HDF5 gets no lock there; set {LOCKING}=FALSE", str(path)) from None
        raise OSError(errno.EIO, str(error), str(path)) from None
    with open(path, "rb+") as handle:  # what was opened for reading only cannot be flushed on Windows
        os.fsync(handle.fileno())


def _dataset(content: bytes) -> xr.Dataset:
    """What the child wrote, as it lay in the file."""
    line, _, rest = content.partition(b"\n")
    header = json.loads(line)
    values, at = memoryview(rest), 0
    variables = {}
    for one in header["variables"]:
        dtype = np.dtype(one["dtype"])
        array = np.frombuffer(values, dtype, count=int(np.prod(one["shape"])), offset=at)
        at += array.nbytes
        variables[one["name"]] = (one["dims"], array.reshape(one["shape"]).copy(), _attributes(one["attributes"]))
    return xr.Dataset(variables, attrs=_attributes(header["attributes"]))


def _attributes(found: dict[str, Any]) -> dict[str, Any]:
    return {
        name: value if isinstance(value, str) else np.array(value[1], dtype=value[0])[()]
        for name, value in found.items()
    }


def _begin(path: Path) -> str | None:
    """The first characters of a text, which is no NetCDF file; None of any other."""
    with open(path, "rb") as file:
        data = file.read(_SHOWN)
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return None
    line = text.strip().partition("\n")[0]
    return line if line and "\0" not in text and not text.startswith("CDF") else None


def _ending(code: int) -> str:
    try:
        name = signal.Signals(-code).name
    except ValueError:
        return f"its reader ended with {code}"
    return "reading it takes too long" if name in ("SIGXCPU", "SIGKILL") else f"its reader crashed: {name}"
