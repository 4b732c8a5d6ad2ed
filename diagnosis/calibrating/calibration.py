"""``calibrate``: from a recording to a system's parameters, how sure they are, and what is left unexplained."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibrated import Calibrated
from diagnosis.calibrating.schema import summarise
from diagnosis.fitting.failures import said_by
from diagnosis.fitting.fit import fit
from diagnosis.fitting.noise import errors_under
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.simulations import Simulations, check_command, side_by_side, simulations
from diagnosis.fitting.starting import PRIOR
from diagnosis.physics import check_physics, check_recording
from diagnosis.recording import HOUR, Recording, check_warm_up, read_recording
from diagnosis.usual import STARTS, WARM_UP
from diagnosis.verdicts import doubt_of
from diagnosis.zero_shot import estimate
from shared.errors import RecordingError
from shared.stretches import LONGEST, Stretch
from shared.system import System, load_system


def opened(
    system: System | Path | str,
    recording: Recording | Path | str | xr.Dataset,
    *,
    noise: str,
    warm_up: float,
    replay: bool = False,
    occupancy: str | None = None,
    stretch: Stretch | None = None,
) -> tuple[System, Recording]:
    """A system with the experiment of a recording, and the recording: whatever is wrong is said before a simulation.

    Parameters
    ----------
    noise
        A noise preset of the description.
    warm_up
        The recording's first day is repeated this long before its start [h].
    replay, occupancy, stretch
        As of :func:`diagnosis.recording.read_recording`.

    Raises
    ------
    SystemDescriptionError
        If the description cannot be used, or has no such preset.
    RecordingError
        If the recording cannot be read or calibrated on, or there is no warm-up.
    """
    described = system if isinstance(system, System) else load_system(system)
    errors_under(described, noise)
    record = taken(described, recording, replay=replay, occupancy=occupancy, stretch=stretch)
    check_recording(record, described)
    check_warm_up(record, warm_up * HOUR)
    return described.with_experiment(step=record.step, hours=len(record.time) * record.step / HOUR), record


def taken(
    system: System,
    recording: Recording | Path | str | xr.Dataset,
    *,
    replay: bool,
    occupancy: str | None,
    stretch: Stretch | None,
) -> Recording:
    """A recording as it is, or the stretch of one that is read from a file.

    Raises
    ------
    RecordingError
        If it cannot be read, or is in memory and a stretch of it is asked for.
    """
    if not isinstance(recording, Recording):
        return read_recording(recording, system, replay=replay, occupancy=occupancy, stretch=stretch)
    if stretch not in (None, LONGEST):
        raise RecordingError(
            f"{recording.path}: stretch is given with a recording that has been read; expected it of read_recording"
        )
    return recording


SPANS = {"fitting": (0.0, 1.0)}


def calibrate(
    system: System | Path | str,
    recording: Recording | Path | str | xr.Dataset,
    *,
    run: Path | str | None = None,
    out: Path | str | None = None,
    replay: bool = False,
    occupancy: str | None = None,
    stretch: Stretch | None = None,
    noise: str = "sensor",
    starts: int = STARTS,
    warm_up: float = WARM_UP,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    minutes: float | None = None,
    within: Simulations | None = None,
) -> Calibrated:
    """Estimate a system's parameters from a recording by simulation.

    Parameters
    ----------
    run
        Folder of an estimator, whose zero-shot estimate is the first start; without, the middle of the prior is.
    out
        Folder for ``calibration.json`` and the page ``calibration.html``, written when all is done. What is
        simulated is saved there until then: a call that is stopped and made again goes on from where it was.
    replay
        The recorded actuators replace the model's control loops.
    occupancy
        ``measured`` or ``unknown``; measured where the recording has it, if not given.
    stretch
        Which stretch without gaps of a recording's inputs is taken; the longest, if not given.
    noise
        A noise preset of the description; by how much errors exceed it, and how slow they are, is estimated.
    starts
        Starts at most. Further ones are drawn from the prior, and tried where a fit leaves more than noise.
    warm_up
        The recording's first day is repeated this long before its start [h], at least a step.
    workers, scheduler
        Processes on this machine (1), or the address of a Dask scheduler, for the simulations.
    minutes
        Time that there is. When it is up, the fit ends with the last round that was made.
    within
        The simulations of a command that this is a part of: its time, and what it has saved.

    Raises
    ------
    RecordingError
        If the recording is shorter than a day, has a constant output, or does not fit the system; if there is
        no warm-up; if the folder cannot be written to.
    SystemDescriptionError, FmuError, SimulationError, EstimatorError
        If the system, its FMU or the estimator cannot be used.
    TimeUp
        If the time was up before there was a fit.
    """
    if starts < 1:
        raise RecordingError(f"starts is {starts}; expected at least 1")
    check_command(out, minutes)
    described, record = opened(
        system, recording, noise=noise, warm_up=warm_up, replay=replay, occupancy=occupancy, stretch=stretch
    )
    zero_shot = estimate(run, record, described) if run is not None else {}
    simulator = Simulator(described)
    place = None if out is None else Path(out)
    with (
        side_by_side(simulator, workers=workers, scheduler=scheduler) as runner,
        simulations(runner, place, simulator, record, minutes=minutes, spans=SPANS, within=within) as made,
    ):
        problem = Problem(
            simulator,
            record,
            noise=noise,
            occupancy=occupancy,
            replay=replay,
            warm_up=warm_up * HOUR,
            runner=made,
        )
        if within is None:
            made.stage("fitting")
        others = np.random.default_rng(seed).standard_normal((starts - 1, problem.size))
        begins = [(f"{run}" if run is not None else PRIOR, problem.unknowns(zero_shot))]
        begins += [("a draw of the prior", one) for one in others]
        with said_by(record.path):
            found = fit(problem, begins, estimate_noise=True)
        report = summarise(found, zero_shot, doubt_of(described))
        report = report.model_copy(update={"physics": check_physics(described, record)})
        done = Calibrated(report, found)
        if place is not None:
            from diagnosis.calibrating.report import write_calibration

            write_calibration(done, place)
    return done
