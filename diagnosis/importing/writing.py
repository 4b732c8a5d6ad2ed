"""The recording's file: NetCDF with CF attributes, flags beside the values, written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from diagnosis.importing.clock import Clock
from diagnosis.importing.series import Series
from shared.errors import RecordingError
from shared.flags import FLAGS
from shared.netcdf import write_netcdf
from shared.schema import SCHEMA_VERSION
from shared.store import temporary_name
from shared.system import System


def build_recording(
    series: Sequence[Series], time: np.ndarray, clock: Clock, system: System, attributes: Mapping[str, str]
) -> xr.Dataset:
    """Put the series on a grid into a dataset as recordings have it.

    Parameters
    ----------
    time
        Ends of the steps, shape (steps,) [s of the clock].
    """
    step = float(time[1] - time[0])
    variables: dict[str, Any] = {"time_bnds": (("time", "bnds"), np.stack([time - step, time], axis=1))}
    described = {one.name: one for one in system.outputs}
    for one in series:
        name = one.target.name
        flag = f"{name}_flag"
        attrs: dict[str, Any] = {
            "long_name": f"input {name}",
            "units": one.target.unit,
            "role": one.target.role,
            "cell_methods": f"time: {one.target.method}",
            "ancillary_variables": flag,
            "comment": one.comment or one.origin,
        }
        if name in described:
            output = described[name]
            attrs["long_name"] = output.long_name or output.name
            if output.standard_name:
                attrs["standard_name"] = output.standard_name
                if "temperature" in output.standard_name:
                    attrs["units_metadata"] = "temperature: on_scale"
        variables[name] = (("time",), one.values.astype(np.float32), attrs)
        flags = {
            "long_name": f"quality of {name}",
            "standard_name": "quality_flag",
            "flag_masks": np.array(list(FLAGS.values()), dtype=np.int8),
            "flag_meanings": " ".join(FLAGS),
        }
        variables[flag] = (("time",), one.flagged(), flags)
    about = {
        "long_name": "end of the step, local standard time",
        "standard_name": "time",
        "units": clock.units,
        "units_metadata": "leap_seconds: none",
        "calendar": "standard",
        "axis": "T",
        "bounds": "time_bnds",
        "comment": f"local standard time is UTC{clock.offset / 3600:+g} h all year; time zero is a Monday",
    }
    attrs = {
        "Conventions": "CF-1.11",
        "title": f"Recording for {system.name}",
        "history": "imported by zeroshot-fmu",
        "zeroshot_schema_version": SCHEMA_VERSION,
        "system_name": system.name,
        "system_hash": system.hash(),
        "time_zone": clock.zone,
        "utc_offset_hours": clock.offset / 3600.0,
        **{name: value for name, value in attributes.items() if value},
    }
    return xr.Dataset(variables, {"time": (("time",), time, about)}, attrs)


def check_free(*paths: Path) -> None:
    """Refuse a path that is a folder, before any work.

    Raises
    ------
    RecordingError
        Naming it.
    """
    for one in paths:
        if one.is_dir():
            raise RecordingError(f"{one}: is a folder; expected a file, or a name that is free")


def write_recording(dataset: xr.Dataset, path: Path, picture: bytes, picture_path: Path) -> None:
    """Write a recording and its picture: both are whole under temporary names before either gets its own.

    The recording gets it first: a picture beside another recording, or none, would be of data that nobody has.

    Raises
    ------
    RecordingError
        If the folder cannot be written to.
    """
    encoding: dict[Any, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        real = variable.dtype.kind == "f" and name not in ("time", "time_bnds")
        encoding[name] = {"_FillValue": np.float32(np.nan) if real else None}
        if variable.dims == ("time",):
            encoding[name] |= {"zlib": name != "time", "complevel": 4}
    temporary, temporary_picture = temporary_name(path), temporary_name(picture_path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written ({error.strerror or error})") from None
    try:
        write_netcdf(dataset, temporary, encoding)
        temporary_picture.write_bytes(picture)
        os.replace(temporary, path)
        os.replace(temporary_picture, picture_path)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)
        temporary_picture.unlink(missing_ok=True)
