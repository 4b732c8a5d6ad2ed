"""The child process of :mod:`shared.netcdf`: opens one NetCDF file and writes what it holds to standard output.

python -P -m shared.netcdf_child FILE BYTES SECONDS

First a line of JSON, then the values of each variable one after another. The C libraries behind NetCDF can crash or run
without end on a damaged file, so they meet foreign files here alone, under limits of memory and time.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

import netCDF4
import numpy as np

DENSEST = 1100
"""Bytes that one byte of a file may stand for; deflate reaches 1032."""
SLACK = 1 << 20
_MEMORY = 6 << 30


def limit(seconds: int) -> None:
    """Bound this process's memory and time, and let it leave no core file, where the system can."""
    if sys.platform == "win32":
        return
    import resource

    for what, most in ((resource.RLIMIT_AS, _MEMORY), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        try:
            resource.setrlimit(what, (most, resource.getrlimit(what)[1]))
        except (ValueError, OSError):  # macOS knows no limit of the address space
            continue


def check_declared(variables: Iterable[netCDF4.Variable], size: int, most: float = math.inf) -> None:
    """Refuse variables that declare more than they can hold in a file of ``size`` bytes, before they are read.

    Raises ValueError if it is so, or they declare more than ``most`` bytes.
    """
    declared = sum(math.prod(one.shape) * np.dtype(one.dtype).itemsize for one in variables)
    most = min(most, DENSEST * size + SLACK)
    if declared > most:
        raise ValueError(f"it declares {declared / 2**20:.0f} MiB, more than the {most / 2**20:.0f} it may hold")


def write(path: Path, most: int, out: BinaryIO) -> None:
    """Write a file's numeric variables, its attributes and theirs; texts and other types are left out.

    Raises ValueError if the file declares more than ``most`` bytes, or more than its own size can hold.
    """
    with open(path, "rb") as file:  # whole in memory: see :mod:`shared.netcdf`
        content = file.read(path.stat().st_size)
    with netCDF4.Dataset("content", memory=content) as data:
        data.set_auto_maskandscale(False)
        chosen = {
            name: one
            for name, one in data.variables.items()
            if isinstance(one.dtype, np.dtype) and one.dtype.kind in "iuf"
        }
        check_declared(chosen.values(), len(content), most)
        header = {
            "attributes": _attributes(data),
            "variables": [
                {
                    "name": name,
                    "dims": one.dimensions,
                    "shape": one.shape,
                    "dtype": one.dtype.newbyteorder("=").str,
                    "attributes": _attributes(one),
                }
                for name, one in chosen.items()
            ],
        }
        out.write(json.dumps(header).encode() + b"\n")
        for one in chosen.values():
            values = np.ascontiguousarray(one[...], dtype=one.dtype.newbyteorder("="))
            if values.size:
                out.write(values.reshape(-1).view(np.uint8).data)


def _attributes(of: netCDF4.Dataset | netCDF4.Variable) -> dict[str, Any]:
    """Texts as they are, numbers as their type and values."""
    found: dict[str, Any] = {}
    for name in of.ncattrs():
        value = of.getncattr(name)
        if isinstance(value, str):
            found[name] = value
        elif isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "iuf":
            found[name] = [value.dtype.newbyteorder("=").str, np.asarray(value).tolist()]
    return found


def main(arguments: list[str]) -> int:
    """Write a file; what is wrong with it is one line on standard error."""
    limit(int(arguments[2]))
    try:
        write(Path(arguments[0]), int(arguments[1]), sys.stdout.buffer)
    except Exception as error:  # whatever the libraries meet in a damaged file
        print(f"{type(error).__name__}: {error}".splitlines()[0], file=sys.stderr)  # noqa: T201
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
