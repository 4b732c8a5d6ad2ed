"""What an estimator says of a recording at once, without a simulation."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from diagnosis.recording import HOUR, Recording
from shared.errors import EstimatorError, RecordingError
from shared.logs import logger
from shared.netcdf import write_netcdf
from shared.stretches import bridge
from shared.system import System
from shared.times import read_recorded

if TYPE_CHECKING:
    from trainer.predicting.prediction import Predictions
    from trainer.runs.checkpoint import Run

_log = logger(__name__)
BRIDGED = 3.0
"""Gaps in a channel up to so long [h] are interpolated for an estimator, where no larger share of its window is missing
than trainings leave out (:data:`trainer.reading.missing.LONGEST`); how many longer ones it can do without, it says
itself. A day that was made up would be one that it was never shown, and so is a week of three made-up hours in four."""


def estimate(run: Path | str, recording: Recording, system: System) -> dict[str, float]:
    """Zero-shot values by name [unit of the description], from the recording's readings and its own span of its file.

    Where the estimator refuses gaps, readings that were lost for a short while (:data:`BRIDGED`) are interpolated, and
    a warning says how many; an output that was never read is left out, which an estimator may be trained to do without.

    Raises
    ------
    EstimatorError
        If the estimator is one of another system.
    RecordingError
        If the recording lacks a channel of the estimator or too much of it, or is shorter than its context; or if there
        is no room for a copy of it among temporary files.
    """
    from trainer import load_run, predict
    from trainer.predicting.readings import GapError

    _, data = read_recorded(recording.path if recording.data is None else recording.data)
    time = recording.times(data)
    data = data.isel(time=np.flatnonzero((time >= recording.time[0] - 1) & (time <= recording.time[-1] + 1)))
    data = data.isel(system=0, drop=True) if "system" in data.dims else data
    for output, readings in zip(system.output_names, recording.outputs, strict=True):
        if output in data and np.isfinite(readings).any():
            data[output].values[:] = readings
        elif output in data:
            data = data.drop_vars(output)
    with tempfile.TemporaryDirectory(prefix="zeroshot-span-") as folder:
        path = Path(folder) / recording.path.name
        _write_span(data, path)
        whole, refused, loaded = None, None, load_run(run)
        try:
            whole = predict(loaded, path)
        except RecordingError as error:
            refused = error
        gaps = isinstance(refused, GapError) if whole is None else whole.passed
        if gaps:  # with short gaps filled it may read all, or a longer window
            least, longest = 0.0 if whole is None else whole.context_hours, round(BRIDGED * HOUR / recording.step)
            try:
                whole = _of_filled(loaded, data, path, least, longest, recording.path) or whole
            except RecordingError as error:
                refused = error
        if whole is None:
            raise RecordingError(str(refused).replace(str(path), str(recording.path))) from None
    if whole.passed:
        _log.warning(
            "the estimator did not read a longer window: %s", whole.passed.replace(str(path), str(recording.path))
        )
    if whole.bridged:
        _log.warning("%s: the estimator interpolated %d readings that were lost singly", recording.path, whole.bridged)
    told = whole.predictions[0]
    for note in told.unlike or ():
        _log.warning("%s: unlike everything in the estimator's training: %s", recording.path, note)
    values_by_name = {name: one.value for name, one in told.parameters.items()}
    _check_parameters(run, values_by_name, system)
    return values_by_name


def check_estimator(run: Path | str, system: System) -> None:
    """Refuse what is no estimator of a system's parameters, before recordings are given to it.

    Raises
    ------
    EstimatorError
        If there is none, one of its files is damaged, or it estimates other parameters.
    """
    from trainer import load_run

    _check_parameters(run, load_run(run).card.encoding.parameters, system)


def _check_parameters(run: Path | str, names: Iterable[str], system: System) -> None:
    if sorted(names) != sorted(system.parameter_names):
        raise EstimatorError(f"{run}: estimates {', '.join(names)}; the system has {', '.join(system.parameter_names)}")


def _write_span(data: xr.Dataset, path: Path) -> None:
    """Write what the estimator is to read into a folder for it that is gone afterwards."""
    try:
        write_netcdf(data, path, {})
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot be written ({error.strerror or error}); expected free space there, or in another folder"
            " that TMPDIR names"
        ) from None


def _of_filled(run: Run, data: xr.Dataset, path: Path, least: float, longest: int, name: Path) -> Predictions | None:
    """An estimate from the longest window, longer than ``least`` [h], that can be read once its short gaps are filled.

    Gaps are of at most ``longest`` steps; ``path`` is where windows are written, ``name`` the recording's own.

    Raises
    ------
    RecordingError
        What the longest window is refused for, if no window can be read and nothing could be read without; or any for
        something else than gaps.
    """
    from trainer import predict
    from trainer.predicting.readings import GapError
    from trainer.reading.missing import LONGEST

    filled = _bridged(data, longest)
    refused: GapError | None = None
    passed: str | None = None
    for length in sorted(run.card.encoding.lengths, reverse=True):
        if length > data.sizes["time"] or length * run.card.encoding.step <= least * HOUR:
            continue
        last = {"time": slice(-length, None)}
        window, read, put = filled.isel(last), data.isel(last), []
        for channel in run.card.encoding.recorded:
            if channel not in read or read[channel].dims != ("time",):
                continue
            lost = int((~np.isfinite(read[channel].values)).sum())
            if lost > LONGEST * length:
                window[channel] = read[channel]
            elif count := lost - int((~np.isfinite(window[channel].values)).sum()):
                put.append(f"{count} of {channel}")
        path.unlink(missing_ok=True)
        _write_span(window, path)
        try:
            found = predict(run, path)
        except GapError as error:  # a shorter window may have fewer
            refused, passed = refused or error, passed or str(error)
            continue
        passed = passed or found.passed
        if found.context_hours * HOUR >= 0.999 * length * run.card.encoding.step:
            if put:
                _log.warning("%s: for the estimator, readings were interpolated: %s", name, ", ".join(put))
            return found.model_copy(update={"passed": passed})
    if refused is not None and not least:
        raise refused
    return None


def _bridged(data: xr.Dataset, longest: int) -> xr.Dataset:
    """A recording whose gaps of at most ``longest`` steps are filled by straight lines."""
    filled = data.copy(deep=True)
    for name in filled.data_vars:
        values = filled[name].values
        if filled[name].dims == ("time",) and np.issubdtype(values.dtype, np.floating):
            _fill(values, longest)
    return filled


def _fill(values: np.ndarray, longest: int) -> None:
    """Fill gaps of at most ``longest`` steps in readings (steps,), in place; at the ends with the reading beside."""
    seen = np.flatnonzero(np.isfinite(values))
    bridge(values, longest)
    for end, inner in ((slice(None, seen[0]), seen[0]), (slice(seen[-1] + 1, None), seen[-1])) if len(seen) else ():
        if len(values[end]) <= longest:
            values[end] = values[inner]
