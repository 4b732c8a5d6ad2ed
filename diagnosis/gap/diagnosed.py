"""The whole diagnosis of one recording: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import xarray as xr

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibration import opened
from diagnosis.effects import Effect, library
from diagnosis.effects.base import foreseen
from diagnosis.effects.library import check_baselines
from diagnosis.fitting.lines import applicable
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.simulations import check_command, side_by_side, simulations
from diagnosis.fitting.starting import begun, usual_starts, zero_shot
from diagnosis.gap.concluded import Diagnosis, concluded
from diagnosis.gap.places import check_places
from diagnosis.gap.reporting import Began
from diagnosis.gap.shrinkage import kept_for_scoring
from diagnosis.physics import check_physics
from diagnosis.recording import HOUR, Recording
from diagnosis.usual import WARM_UP
from diagnosis.verdicts import verdicts_of
from shared.logs import logger
from shared.stretches import Stretch
from shared.system import System

_log = logger(__name__)
SPANS = {
    "fitting the base model": (0.0, 0.2),
    "sensitivities": (0.2, 0.25),
    "looking at all": (0.25, 0.4),
    "refitting": (0.4, 0.7),
    "finding where": (0.7, 0.75),
    "scoring": (0.75, 0.99),
    "writing": (0.99, 1.0),
}
"""Of the stages of a diagnosis; where one is left out there is less of it."""


def diagnose(
    system: System | Path | str,
    recording: Recording | Path | str | xr.Dataset,
    *,
    run: Path | str | None = None,
    out: Path | str | None = None,
    replay: bool = False,
    occupancy: str | None = None,
    stretch: Stretch | None = None,
    noise: str = "sensor",
    effects: Sequence[Effect] | None = None,
    warm_up: float = WARM_UP,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    minutes: float | None = None,
    how_far: bool = True,
) -> Diagnosis:
    """Diagnose the gap between a recording and its system's model.

    Parameters
    ----------
    run
        Folder of an estimator, whose zero-shot estimate is the first start; without, the estimator beside the system
        description is asked, if there is one that can read the recording. The middle of the prior is a further start.
    out
        Folder for ``report.json`` and the page ``report.html``, written when all is done. What is simulated is saved
        there until then: a call that is stopped and made again goes on from where it was.
    replay
        The recorded actuators replace the model's control loops.
    occupancy
        ``measured`` or ``unknown``; measured where the recording has it, if not given.
    stretch
        Which stretch without gaps of a recording's inputs is taken; the longest, if not given.
    noise
        A noise preset of the description.
    effects
        Candidates; those of the description and of installed packages if not given.
    warm_up
        The recording's first day is repeated this long before its start [h], at least a step.
    seed
        Of twins, placebos and bootstraps.
    workers, scheduler
        Processes on this machine (1), or the address of a Dask scheduler, for the simulations.
    minutes
        Time that there is. When it is up, the answer is what is known then, and says what it lacks.
    how_far
        Whether the chosen effects are fitted again without some days, to say how far the gap shrinks on these.

    Raises
    ------
    RecordingError
        If the recording is shorter than a day or than four steps, was hardly read, or does not fit the system; if there
        is no warm-up; if the folder cannot be written to.
    SystemDescriptionError, FmuError, SimulationError, EstimatorError
        If the system, its effects, its FMU or the estimator cannot be used.
    TimeUp
        If the time was up before the base model was fitted.
    """
    began = Began.now(0)
    check_command(out, minutes)
    described, record = opened(
        system, recording, noise=noise, warm_up=warm_up, replay=replay, occupancy=occupancy, stretch=stretch
    )
    _log.info("holding the recording against physics")
    physics = check_physics(described, record)
    candidates = list(effects) if effects is not None else library(described)
    estimated = zero_shot(described, record, run)
    simulator = Simulator(described)
    check_baselines(candidates, described, simulator.fmu, replay=replay)
    by = verdicts_of(described, candidates, simulator.fmu.sha256, noise)
    place = None if out is None else Path(out)
    with (
        side_by_side(simulator, workers=workers, scheduler=scheduler) as runner,
        simulations(runner, place, simulator, record, minutes=minutes, spans=SPANS) as made,
    ):
        whole = Problem(
            simulator,
            record,
            noise=noise,
            occupancy=occupancy,
            replay=replay,
            warm_up=warm_up * HOUR,
            runner=made,
        )
        whole = whole.with_observed(foreseen(applicable(whole, candidates)[0], record))
        check_places(record, whole.observed)
        scored = kept_for_scoring(record) | (not how_far)
        made.stage("fitting the base model")
        origin = begun(whole, usual_starts(whole, estimated))
        done = concluded(whole, origin, candidates, scored, seed, began, by)
        done = replace(done, report=done.report.model_copy(update={"physics": physics}))
        if place is not None:
            from diagnosis.gap.page import write_report

            made.stage("writing the report")
            write_report(done, place)
    return done
