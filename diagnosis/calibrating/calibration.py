"""``calibrate``: from a recording to a system's parameters, how sure they are, and what is left unexplained."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.checks import opened
from diagnosis.calibrating.schema import Calibration, read_calibration
from diagnosis.calibrating.summary import summarise
from diagnosis.fitting.fit import Fit, fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.side_by_side import side_by_side
from diagnosis.recording import HOUR, Recording
from diagnosis.usual import STARTS, WARM_UP
from diagnosis.whole import whole
from shared.errors import EstimatorError, RecordingError
from shared.logs import logger
from shared.netcdf import read_netcdf, write_netcdf
from shared.places import check_folder
from shared.system import System

_log = logger(__name__)
__all__ = ["Calibrated", "Calibration", "calibrate", "estimate", "read_calibration", "whole"]

BRIDGED = 3.0
"""Gaps in a channel up to so long [h] are interpolated for an estimator; how many longer ones it can do without, it
says itself. A day that was made up would be one that it was never shown."""


@dataclass(frozen=True)
class Calibrated:
    """A calibration and what it was made from, for whoever goes on: forecasts, pictures, effects."""

    report: Calibration
    fit: Fit

    @property
    def problem(self) -> Problem:
        """The problem as it was fitted in the end."""
        return self.fit.problem


def calibrate(
    system: System | Path | str,
    recording: Recording | Path | str,
    *,
    run: Path | str | None = None,
    out: Path | str | None = None,
    replay: bool = False,
    occupancy: str | None = None,
    noise: str = "sensor",
    estimate_noise: bool = True,
    starts: int = STARTS,
    warm_up: float = WARM_UP,
    seed: int = 0,
    workers: int = 1,
    scheduler: str | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Calibrated:
    """Estimate a system's parameters from a recording by simulation.

    Parameters
    ----------
    run
        Folder of an estimator, whose zero-shot estimate is the first start; without, the middle of the prior is.
    out
        Folder for ``calibration.json`` and the page ``calibration.html``, written when all is done.
    replay
        The recorded actuators replace the model's control loops.
    occupancy
        ``measured`` or ``unknown``; measured where the recording has it, if not given.
    noise
        A noise preset of the description.
    estimate_noise
        Estimate by how much the outputs' errors exceed that, and how slow they are.
    starts
        Starts in all; further ones are drawn from the prior.
    warm_up
        The recording's first day is repeated this long before its start [h], at least a step.
    workers, scheduler
        Processes on this machine, or the address of a Dask scheduler, for the simulations.
    tell
        Is told when what was given is found in order, and simulations begin.

    Raises
    ------
    RecordingError
        If the recording is shorter than a day, has a constant output, or does not fit the system; if there is
        no warm-up; if the folder cannot be written to.
    SystemDescriptionError, FmuError, SimulationError, EstimatorError
        If the system, its FMU or the estimator cannot be used.
    """
    if starts < 1:
        raise RecordingError(f"starts is {starts}; expected at least 1")
    if out is not None:
        check_folder(Path(out), RecordingError)
    described, record = opened(system, recording, noise=noise, warm_up=warm_up)
    zero_shot = estimate(run, record, described) if run is not None else {}
    simulator = Simulator(described)
    with side_by_side(simulator, workers=workers, scheduler=scheduler) as runner:
        problem = Problem(
            simulator,
            record,
            noise=noise,
            occupancy=occupancy,
            replay=replay,
            warm_up=warm_up * HOUR,
            runner=runner,
        )
        tell("simulating")
        first = problem.unknowns(zero_shot)
        others = np.random.default_rng(seed).standard_normal((max(starts - 1, 0), problem.size))
        found = fit(problem, [first, *others], estimate_noise=estimate_noise)
        further = f" and {starts - 1} draws of the prior" if starts > 1 else ""
        report = summarise(found, zero_shot, f"{run if run is not None else 'prior'}{further}")
    done = Calibrated(report, found)
    if out is not None:
        from diagnosis.calibrating.report import write_calibration

        write_calibration(done, Path(out))
    return done


def estimate(run: Path | str, recording: Recording, system: System) -> dict[str, float]:
    """Zero-shot values by name [unit of the description], from the recording's readings and its own span of its file.

    Where the estimator refuses gaps, readings that were lost for a short while (:data:`BRIDGED`) are interpolated; an
    output that was never read is left out, which an estimator may be trained to do without.

    Raises
    ------
    EstimatorError
        If the estimator is one of another system.
    RecordingError
        If the recording lacks a channel of the estimator or too much of it, or is shorter than its context; or if there
        is no room for a copy of it among temporary files.
    """
    from trainer import predict

    data = read_netcdf(recording.path, RecordingError, "a recording (NetCDF)", times=True)
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
        try:
            told = predict(run, path).predictions[0]
        except RecordingError:
            bridged = _bridged(data, round(BRIDGED * HOUR / recording.step))
            path.unlink()
            _write_span(bridged, path)
            try:
                told = predict(run, path).predictions[0]
            except RecordingError as error:
                raise RecordingError(str(error).replace(str(path), str(recording.path))) from None
    for note in told.unlike or ():
        _log.warning("%s: unlike all that the estimator was trained on: %s", recording.path, note)
    values_by_name = {name: one.value for name, one in told.parameters.items()}
    if sorted(values_by_name) != sorted(system.parameter_names):
        raise EstimatorError(
            f"{run}: estimates {', '.join(values_by_name)}; the system has {', '.join(system.parameter_names)}"
        )
    return values_by_name


def _write_span(data: xr.Dataset, path: Path) -> None:
    """Write what the estimator is to read into a folder for it that is gone afterwards."""
    try:
        write_netcdf(data, path, {})
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot be written ({error.strerror or error}); expected free space there, or in another folder"
            " that TMPDIR names"
        ) from None


def _bridged(data: xr.Dataset, longest: int) -> xr.Dataset:
    """A recording whose gaps of at most ``longest`` steps are filled by straight lines."""
    filled = data.copy(deep=True)
    for name in filled.data_vars:
        values = filled[name].values
        if filled[name].dims == ("time",) and np.issubdtype(values.dtype, np.floating):
            _bridge(values, longest)
    return filled


def _bridge(values: np.ndarray, longest: int) -> None:
    """Fill gaps of at most ``longest`` steps in readings (steps,) by straight lines, in place."""
    seen = np.flatnonzero(np.isfinite(values))
    for before, after in pairwise(seen):
        if 1 < after - before <= longest + 1:
            values[before : after + 1] = np.linspace(values[before], values[after], after - before + 1)
    for end, inner in ((slice(None, seen[0]), seen[0]), (slice(seen[-1] + 1, None), seen[-1])) if len(seen) else ():
        if len(values[end]) <= longest:
            values[end] = values[inner]
