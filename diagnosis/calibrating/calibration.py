"""``calibrate``: from a recording to a system's parameters, how sure they are, and what is left unexplained."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibrated import Calibrated
from diagnosis.calibrating.checks import opened
from diagnosis.calibrating.schema import Calibration, read_calibration
from diagnosis.calibrating.summary import summarise
from diagnosis.fitting.failures import said_by
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.side_by_side import side_by_side
from diagnosis.fitting.simulations import Simulations, simulations
from diagnosis.physics import check_physics
from diagnosis.recording import HOUR, Recording
from diagnosis.usual import STARTS, WARM_UP
from diagnosis.whole import whole
from diagnosis.zero_shot import estimate
from shared.errors import RecordingError
from shared.numbers import counted
from shared.places import check_folder
from shared.stretches import Stretch
from shared.system import System

__all__ = ["Calibrated", "Calibration", "calibrate", "read_calibration", "whole"]


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
    estimate_noise: bool = True,
    starts: int = STARTS,
    warm_up: float = WARM_UP,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    minutes: float | None = None,
    tell: Callable[[str], None] = lambda _: None,
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
        A noise preset of the description.
    estimate_noise
        Estimate by how much the outputs' errors exceed that, and how slow they are.
    starts
        Starts in all; further ones are drawn from the prior.
    warm_up
        The recording's first day is repeated this long before its start [h], at least a step.
    workers, scheduler
        Processes on this machine (1), or the address of a Dask scheduler, for the simulations.
    minutes
        Time that there is. When it is up, the fit ends with the last round that was made.
    tell
        Is told what is being done when that changes and every half minute, and roughly how long it will still take.
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
    if out is not None:
        check_folder(Path(out), RecordingError)
    described, record = opened(
        system, recording, noise=noise, warm_up=warm_up, replay=replay, occupancy=occupancy, stretch=stretch
    )
    zero_shot = estimate(run, record, described) if run is not None else {}
    simulator = Simulator(described)
    place = None if out is None else Path(out)
    with (
        side_by_side(simulator, workers=workers, scheduler=scheduler) as runner,
        simulations(runner, place, simulator, record, minutes=minutes, tell=tell, within=within) as made,
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
            made.tell("fitting", 0.0, 1.0)
        first = problem.unknowns(zero_shot)
        others = np.random.default_rng(seed).standard_normal((max(starts - 1, 0), problem.size))
        with said_by(record.path):
            found = fit(problem, [first, *others], estimate_noise=estimate_noise)
        further = f" and {counted(starts - 1, 'draw')} of the prior" if starts > 1 else ""
        report = summarise(found, zero_shot, f"{run if run is not None else 'prior'}{further}")
        report = report.model_copy(update={"physics": check_physics(described, record)})
        done = Calibrated(report, found)
        if place is not None:
            from diagnosis.calibrating.report import write_calibration

            write_calibration(done, place)
    return done
