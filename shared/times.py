"""The time of recordings: what a file says, as seconds since time zero.

A file's time is dates in any CF units, or it is elapsed since the record's own beginning, which then is in ``start``.
Dates are local standard time and never moved by an offset: who wants another clock says so before.
"""

from __future__ import annotations

import re
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import xarray as xr

from shared.errors import RecordingError
from shared.netcdf import read_netcdf
from shared.reading import newer, shown
from shared.schema import EPOCH, RECORDING, SCHEMA_VERSION, dataset_hash

_PLAIN = re.compile(r"\s*\d{4}-\d{1,2}-\d{1,2}([ T]+\d{1,2}(:\d{1,2}(:\d{1,2}(\.\d*)?)?)?)?\s*")
"""A date without an offset from UTC."""
YEARS = (1900, 2201)
"""A record begins in one of these years, the second excluded."""


def read_recorded(given: Path | str | xr.Dataset) -> tuple[Path, xr.Dataset]:
    """What was recorded, decoded as the CF conventions have it but for time spans, and what it is called in sentences.

    ``given`` is a NetCDF file, or what is in memory already, decoded or not. In memory it is called by the file that it
    came from, or by its content; dates without CF units are taken for local standard time. Raises RecordingError if the
    file cannot be read, or what is in memory cannot be decoded.
    """
    if not isinstance(given, xr.Dataset):
        return Path(given), read_netcdf(Path(given), RecordingError, RECORDING, times=True)
    source = given.encoding.get("source")
    path = Path(source) if source else Path(f"dataset-{dataset_hash(given)[:12]}")
    try:
        data = xr.decode_cf(given, decode_times=True, decode_timedelta=False).load().copy()
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: cannot be decoded ({error}); expected {RECORDING}") from None
    if "time" in data.coords and np.issubdtype(data["time"].dtype, np.datetime64):
        data["time"].encoding.setdefault("units", f"seconds since {EPOCH}")
    return path, data


def recorded_times(path: Path, recording: xr.Dataset) -> np.ndarray:
    """Ends of the steps, shape (time,) [s since time zero, or since the record's beginning where that is apart].

    Raises RecordingError if time is missing, has other dimensions, or is neither dates nor elapsed seconds; or if the
    file is of a newer major version of the schema.
    """
    if said := newer(recording.attrs.get("zeroshot_schema_version", 0), int(SCHEMA_VERSION.split(".")[0])):
        raise RecordingError(f"{path}: {said}")
    if "time" not in recording.coords:
        found = ", ".join(map(str, recording.coords))
        raise RecordingError(f"{path}: has no coordinate 'time'; found {found or 'none'}")
    time = recording["time"]
    if time.dims != ("time",):
        raise RecordingError(f"{path}: time has dimensions {time.dims}; expected ('time',)")
    if np.issubdtype(time.dtype, np.datetime64):
        units = str(time.encoding.get("units", ""))
        if not _PLAIN.fullmatch(units.partition(" since ")[2]):
            raise RecordingError(
                f"{path}: time is in {shown(units)}; expected local standard time, as 'hours since 2022-02-01 00:00',"
                " without an offset from UTC"
            )
        return _ends(path, recording, _seconds(time.values))
    if time.dtype.kind in "iuf" and time.attrs.get("units") == "s" and "start" in recording.data_vars:
        return _ends(path, recording, time.values.astype(np.float64))
    given = time.attrs.get("units", time.encoding.get("units"))
    found = "has no units" if given is None else f"is in {shown(given)}, which are not dates of the standard calendar"
    raise RecordingError(f"{path}: time {found}; expected for example 'seconds since {EPOCH}'")


def recorded_begins(path: Path, recording: xr.Dataset, count: int) -> np.ndarray:
    """When each of so many records begins, shape (count,) [s since time zero]; zeros where nothing says so.

    Raises RecordingError if ``start`` is not one finite number or date for each, of the years 1900 to 2200.
    """
    if "start" not in recording.data_vars:
        return np.zeros(count)
    starts = recording["start"]
    time = recording.get("time")
    if time is not None and np.issubdtype(time.dtype, np.datetime64):
        # dates are whole by themselves, but for those of shards before 2.1 of the schema, which all are of January
        version = str(recording.attrs.get("zeroshot_schema_version", "")).split(".")
        if version not in (["2", "0"], ["1", "0"]) and not _all_at_time_zero(starts):
            raise RecordingError(f"{path}: has dates in time, and a start beside it; expected one of them")
    if starts.ndim > 1 or starts.size not in (1, count) or starts.dtype.kind not in "iufM":
        raise RecordingError(f"{path}: start has {starts.size} values; expected one number or date for each system")
    unit = str(starts.attrs.get("units", "s"))
    if starts.dtype.kind in "iuf" and unit not in ("s", "seconds"):
        raise RecordingError(f"{path}: start is in {unit!r}; expected seconds since time zero, or a date")
    dated = np.issubdtype(starts.dtype, np.datetime64)  # before 2.1 of the schema it was a number
    seconds = _seconds(starts.values) if dated else starts.values.astype(np.float64)
    if not np.isfinite(seconds).all():
        raise RecordingError(f"{path}: start has values that are not finite; expected one number or date a system")
    first, last = ((np.datetime64(f"{year}-01-01") - np.datetime64(EPOCH)) / np.timedelta64(1, "s") for year in YEARS)
    beyond = (seconds < first) | (seconds >= last)
    if beyond.any():  # also what NetCDF puts where nothing was written, 9.97e36
        found = starts.values[beyond].flat[0]
        told = str(found)[:19] if dated else f"{found:g} s since time zero ({EPOCH})"
        raise RecordingError(f"{path}: start is {told}; expected a time in the years {YEARS[0]} to {YEARS[1] - 1}")
    return np.array(np.broadcast_to(seconds.reshape(-1), (count,)))


def time_zero(day: date) -> date:
    """The Monday nearest to 1 January of a day's year."""
    first = date(day.year, 1, 1)
    after = -first.weekday() % 7
    return first + timedelta(days=after if after <= 3 else after - 7)


def _all_at_time_zero(starts: xr.DataArray) -> bool:
    dated = np.issubdtype(starts.dtype, np.datetime64)
    return bool(((_seconds(starts.values) if dated else starts.values) == 0).all())


def _ends(path: Path, recording: xr.Dataset, times: np.ndarray) -> np.ndarray:
    """Times that are the ends of their own bounds, if the file has any."""
    name = recording["time"].attrs.get("bounds", recording["time"].encoding.get("bounds"))
    if not isinstance(name, str) or name not in recording or recording[name].shape != (len(times), 2):
        return times
    bounds = recording[name].values[:, 1]
    ends = _seconds(bounds) if np.issubdtype(bounds.dtype, np.datetime64) else bounds.astype(np.float64)
    if (np.abs(ends - times) > 1.0).any():  # what is no number says nothing
        raise RecordingError(f"{path}: time is not the end of the steps in {name}; expected the end of each step")
    return times


def _seconds(dates: np.ndarray) -> np.ndarray:
    """Of dates since time zero, NaN where there is no date."""
    return np.asarray((dates - np.datetime64(EPOCH)) / np.timedelta64(1, "s"), dtype=np.float64)
