"""The whole diagnosis of one recording: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.checks import opened
from diagnosis.effects import Effect, library
from diagnosis.effects.baselines import check_baselines
from diagnosis.effects.edges import foreseen
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.run import Run
from diagnosis.fitting.side_by_side import InProcess, Outcome, Runner, side_by_side
from diagnosis.gap.concluded import Diagnosis, concluded
from diagnosis.gap.linear import applicable
from diagnosis.gap.parts import kept_for_scoring
from diagnosis.gap.places import check_places
from diagnosis.gap.starting import begun, zero_shot
from diagnosis.recording import HOUR, Recording
from diagnosis.usual import WARM_UP
from shared.errors import RecordingError
from shared.places import check_folder
from shared.stretches import Stretch
from shared.system import System


class _Held:
    """A runner that can be exchanged in all problems that have it: processes end with the diagnosis they ran for."""

    def __init__(self, runner: Runner) -> None:
        self.runner = runner

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`diagnosis.fitting.side_by_side.Runner`."""
        return self.runner.map(runs)


def diagnose(
    system: System | Path | str,
    recording: Recording | Path | str,
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
    tell: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose the gap between a recording and its system's model.

    Parameters
    ----------
    run
        Folder of an estimator, whose zero-shot estimate is the first start; without, the estimator beside the system
        description is asked, if there is one that can read the recording. The middle of the prior is a further start.
    out
        Folder for ``report.json`` and the page ``report.html``, written when all is done.
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
    tell
        Is told what is being done.

    Raises
    ------
    RecordingError
        If the recording is shorter than a day or than four steps, was hardly read, or does not fit the system; if there
        is no warm-up; if the folder cannot be written to.
    SystemDescriptionError, FmuError, SimulationError, EstimatorError
        If the system, its effects, its FMU or the estimator cannot be used.
    """
    began, used = time.perf_counter(), time.process_time()
    if out is not None:
        check_folder(Path(out), RecordingError)
    described, record = opened(
        system, recording, noise=noise, warm_up=warm_up, replay=replay, occupancy=occupancy, stretch=stretch
    )
    candidates = list(effects) if effects is not None else library(described)
    estimated = zero_shot(described, record, run, tell)
    simulator = Simulator(described)
    check_baselines(candidates, described, simulator.fmu, replay=replay)
    with side_by_side(simulator, workers=workers, scheduler=scheduler) as runner:
        held = _Held(runner)
        whole = Problem(
            simulator,
            record,
            noise=noise,
            occupancy=occupancy,
            replay=replay,
            warm_up=warm_up * HOUR,
            runner=held,
        )
        whole = whole.with_observed(foreseen(applicable(whole, candidates)[0], record))
        check_places(record, whole.observed)
        scored = kept_for_scoring(record)
        tell("fitting the base model")
        origin = begun(whole, estimated)
        done = concluded(whole, origin, candidates, scored, seed, (began, used), tell)
    held.runner = InProcess(simulator)
    if out is not None:
        from diagnosis.gap.page import write_report

        tell("writing the report")
        write_report(done, Path(out))
    return done
