"""Estimate the parameters behind one recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from pydantic import BaseModel, ConfigDict

from shared.errors import RecordingError
from shared.schema import EPOCH
from trainer.checkpoint import Run, load_run
from trainer.encoding import Encoding

NEAR = 1e-3
"""An estimate this close to an end of its range, as a share of the range, is said to lie at its bound."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Estimate(_Table):
    """One parameter. ``rmse`` is the root mean square error of such estimates on validation systems [unit]."""

    value: float
    unit: str
    rmse: float
    at_bound: bool


class Prediction(_Table):
    """Parameters of one system, from the window that ends at ``end``."""

    system: int | None
    begin: str
    end: str
    parameters: dict[str, Estimate]


class Predictions(_Table):
    """What ``trainer predict`` prints."""

    schema_version: int = 1
    file: str
    model: str
    context_hours: float
    noise: str
    predictions: list[Prediction]


def predict(run: Run | Path | str, file: Path | str) -> Predictions:
    """Estimate parameters from a recording: one forward pass over its last context window.

    Parameters
    ----------
    run
        A run folder, or a run already loaded.
    file
        NetCDF with the run's recorded channels as variables over (time) or (system, time), each with ``units``, and a
        ``time`` coordinate, as the shards of a dataset have it. Each system of it is estimated by itself.

    Raises
    ------
    RecordingError
        If the recording cannot be read, or its channels, units, step, length or values do not fit the run.
    EstimatorError
        If the run cannot be used.
    """
    run = run if isinstance(run, Run) else load_run(run)
    encoding = run.card.encoding
    values, stamps, systems = read_window(Path(file), encoding)
    estimates = run.estimate(values, np.full(len(values), stamps[0]))
    begin, end = (str(np.datetime64(EPOCH, "s") + np.timedelta64(round(s), "s")) for s in (stamps[0], stamps[-1]))
    low, high = np.array(encoding.parameter_min), np.array(encoding.parameter_max)
    near = NEAR * (high - low)
    predictions = []
    for system, row in zip(systems, estimates, strict=True):
        parameters = {
            name: Estimate(
                value=float(row[k]),
                unit=encoding.parameter_units[k],
                rmse=run.card.validation_rmse[name],
                at_bound=bool(row[k] < low[k] + near[k] or row[k] > high[k] - near[k]),
            )
            for k, name in enumerate(encoding.parameters)
        }
        predictions.append(Prediction(system=system, begin=begin, end=end, parameters=parameters))
    return Predictions(
        file=str(file),
        model=run.card.model,
        context_hours=run.card.context_hours,
        noise=run.card.noise,
        predictions=predictions,
    )


def read_window(path: Path, encoding: Encoding) -> tuple[np.ndarray, np.ndarray, list[int | None]]:
    """The last context window of a recording.

    Returns
    -------
    tuple
        Values float32 (systems, length, recorded) [the run's units], time stamps (length,) [s since time zero], and the
        systems' indices (None for a recording without them).

    Raises
    ------
    RecordingError
        If the recording does not fit the run; the sentence says in what.
    """
    try:
        recording = xr.load_dataset(path, engine="netcdf4", decode_timedelta=False)
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file; expected a recording (NetCDF)") from None
    except (OSError, RuntimeError, ValueError) as error:
        raise RecordingError(f"{path}: cannot be read as NetCDF ({error})") from None
    stamps = _stamps(path, recording, encoding)
    wanted = zip(encoding.recorded, encoding.units, strict=True)
    series = [_channel(path, recording, name, unit) for name, unit in wanted]
    # a channel that all systems share may come without the dimension system
    values = np.stack(np.broadcast_arrays(*(one[..., -encoding.length :] for one in series)), axis=-1)
    for k, name in enumerate(encoding.recorded):
        bad = ~np.isfinite(values[..., k])
        if bad.any():
            raise RecordingError(
                f"{path}: {name} has {int(bad.sum())} missing or infinite values in its last {encoding.length} samples;"
                " expected none: fill them first, for example by holding the last value"
            )
    indices: list[int | None] = [None]
    if values.ndim == 3:
        known = "system" in recording.coords
        indices = [int(i) for i in recording["system"].values] if known else list(range(len(values)))
    return values.reshape(-1, encoding.length, len(encoding.recorded)), stamps, indices


def _stamps(path: Path, recording: xr.Dataset, encoding: Encoding) -> np.ndarray:
    """Time stamps of the last context window [s since time zero]."""
    if "time" not in recording.coords:
        found = ", ".join(map(str, recording.coords))
        raise RecordingError(f"{path}: has no coordinate 'time'; found {found or 'none'}")
    time = recording["time"]
    if not np.issubdtype(time.dtype, np.datetime64):
        raise RecordingError(f"{path}: time has no units; expected for example 'seconds since {EPOCH}'")
    seconds = (time.values - np.datetime64(EPOCH)) / np.timedelta64(1, "s")
    if len(seconds) < encoding.length:
        hours = len(seconds) * encoding.step / 3600
        raise RecordingError(
            f"{path}: has {len(seconds)} samples ({hours:g} h at the run's step);"
            f" the run needs {encoding.length} ({encoding.length * encoding.step / 3600:g} h)"
        )
    window = seconds[-encoding.length :]
    steps = np.diff(window)
    wrong = np.flatnonzero(~(np.abs(steps - encoding.step) <= 1e-3 * encoding.step))
    if len(wrong):
        where = time.values[-encoding.length :][wrong[0]].astype("M8[s]")
        raise RecordingError(
            f"{path}: its step is {steps[wrong[0]]:g} s after {where};"
            f" the run was trained on steps of {encoding.step:g} s throughout"
        )
    return np.asarray(window, dtype=np.float64)


def _channel(path: Path, recording: xr.Dataset, name: str, unit: str) -> np.ndarray:
    """One channel, (time,) or (system, time), in the run's unit."""
    if name not in recording.data_vars:
        found = ", ".join(str(n) for n, v in recording.data_vars.items() if "time" in v.dims)
        raise RecordingError(f"{path}: has no channel {name!r}, which the run reads; found {found or 'none'}")
    variable = recording[name]
    units = variable.attrs.get("units")
    if units is None:
        raise RecordingError(f"{path}: {name} has no units; the run expects {unit!r}")
    if units != unit:
        raise RecordingError(f"{path}: {name} is in {units!r}; the run expects {unit!r}: convert it first")
    if variable.dims not in (("time",), ("system", "time")):
        raise RecordingError(
            f"{path}: {name} has dimensions ({', '.join(map(str, variable.dims))}); expected (time) or (system, time)"
        )
    return variable.values.astype(np.float32)
