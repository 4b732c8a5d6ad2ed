"""The last context window of a recording, as an estimator reads it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from shared.errors import RecordingError
from shared.netcdf import read_netcdf
from shared.reading import shown
from shared.schema import Method, method_fault
from shared.times import recorded_begins, recorded_times
from trainer.predicting.readings import check_gaps, comparable, date_of
from trainer.reading.encoding import Encoding


class Window(NamedTuple):
    """The last context window of a recording.

    ``values`` float32 (systems, length, recorded) [the run's units], ``stamps`` (length,) [s since time zero, or since
    ``begins``], ``begins`` (systems,) [s since time zero], ``systems`` their indices (None for a recording without
    them), ``absent`` the optional channels that the recording lacks.
    """

    values: np.ndarray
    stamps: np.ndarray
    begins: np.ndarray
    systems: list[int | None]
    absent: list[str]


def read_window(path: Path, encoding: Encoding) -> Window:
    """The last context window of a recording: the longest that it has of those that the run was trained on.

    Raises
    ------
    RecordingError
        If the recording does not fit the run; the sentence says in what.
    """
    recording = read_netcdf(path, RecordingError, "a recording (NetCDF)", times=True)
    stamps = _stamps(path, recording, encoding)
    length = len(stamps)
    absent = [name for name in encoding.optional if name not in recording.data_vars]
    methods: list[Method] | list[None] = encoding.methods or [None] * len(encoding.recorded)
    series = [
        np.full(length, np.nan, dtype=np.float32) if name in absent else _channel(path, recording, name, unit, method)
        for name, unit, method in zip(encoding.recorded, encoding.units, methods, strict=True)
    ]
    # a channel that all systems share may come without the dimension system
    values = np.stack(np.broadcast_arrays(*(one[..., -length:] for one in series)), axis=-1)
    indices: list[int | None] = [None]
    if values.ndim == 3:
        known = "system" in recording.coords and recording["system"].dtype.kind in "iu"
        indices = [int(i) for i in recording["system"].values] if known else list(range(len(values)))
    if not len(indices):
        raise RecordingError(f"{path}: its dimension system is empty; expected at least one system")
    values = values.reshape(-1, length, len(encoding.recorded))
    for k, name in enumerate(encoding.recorded):
        if name not in absent:
            check_gaps(path, name, values[..., k], indices, encoding.largest_gap if k < encoding.outputs else 0.0)
    begins = recorded_begins(path, recording, len(values))
    values = comparable(path, values, begins[:, None] + stamps, indices, encoding)
    return Window(values, stamps, begins, indices, absent)


def _stamps(path: Path, recording: xr.Dataset, encoding: Encoding) -> np.ndarray:
    """Time stamps of the last context window [s since time zero]."""
    seconds = recorded_times(path, recording)
    lengths = [length for length in encoding.lengths if length <= len(seconds)]
    if not lengths:
        hours, least = len(seconds) * encoding.step / 3600, min(encoding.lengths)
        raise RecordingError(
            f"{path}: has {len(seconds)} samples ({hours:g} h at the run's step);"
            f" the run needs {least} ({least * encoding.step / 3600:g} h)"
        )
    window = seconds[-max(lengths) :]
    steps = np.diff(window)
    wrong = np.flatnonzero(~(np.abs(steps - encoding.step) <= 1e-3 * encoding.step))
    if len(wrong):
        at = float(window[wrong[0]])
        dated = np.issubdtype(recording["time"].dtype, np.datetime64) and np.isfinite(at)
        where = date_of(at) if dated else f"{at:g} s"
        raise RecordingError(
            f"{path}: its step is {steps[wrong[0]]:g} s after {where};"
            f" the run was trained on steps of {encoding.step:g} s throughout"
        )
    return np.asarray(window, dtype=np.float64)


def _channel(path: Path, recording: xr.Dataset, name: str, unit: str, method: Method | None) -> np.ndarray:
    """One channel, (time,) or (system, time), in the run's unit and of its cell method, where that is known."""
    if name not in recording.data_vars:
        found = ", ".join(str(n) for n, v in recording.data_vars.items() if "time" in v.dims)
        raise RecordingError(f"{path}: has no channel {name!r}, which the run reads; found {found or 'none'}")
    variable = recording[name]
    units = variable.attrs.get("units")
    if units is None:
        raise RecordingError(f"{path}: {name} has no units; the run expects {unit!r}")
    if not isinstance(units, str) or units != unit:
        raise RecordingError(f"{path}: {name} is in {shown(units)}; the run expects {unit!r}: convert it first")
    if method is not None and (fault := method_fault(variable.attrs, method, "for the run")):
        raise RecordingError(f"{path}: {name} {fault}")
    if variable.dims not in (("time",), ("system", "time")):
        raise RecordingError(
            f"{path}: {name} has dimensions ({', '.join(map(str, variable.dims))}); expected (time) or (system, time)"
        )
    with np.errstate(over="ignore"):  # beyond a float32 is infinite, and refused as such
        return variable.values.astype(np.float32)
