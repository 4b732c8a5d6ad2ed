"""The whole diagnosis of one recording: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from datagen.simulator import Simulator
from diagnosis.calibrating.calibration import estimate
from diagnosis.calibrating.checks import check_recording
from diagnosis.effects import Effect, library
from diagnosis.fitting.fit import Fit, fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.side_by_side import side_by_side
from diagnosis.gap.decision import Decision, decide, gap_found
from diagnosis.gap.parts import kept_for_scoring
from diagnosis.gap.places import operators, place
from diagnosis.gap.schema import Report
from diagnosis.gap.search import Search, search
from diagnosis.gap.shrinkage import Shrinkage, shrinkages
from diagnosis.recording import HOUR, Recording, read_recording
from diagnosis.where import Where
from shared.system import System, load_system

ROUNDS = 2
STARTS = 1


@dataclass(frozen=True)
class Diagnosis:
    """A diagnosis and all that it was made from. ``where_left`` is with the chosen effects, if there are any."""

    report: Report
    base: Fit
    search: Search
    decision: Decision
    where: Where
    where_left: Where | None
    shrinkage: list[Shrinkage]
    scored: np.ndarray


def diagnose(
    system: System | Path | str,
    recording: Recording | Path | str,
    *,
    run: Path | str | None = None,
    out: Path | str | None = None,
    replay: bool = False,
    occupancy: str | None = None,
    noise: str = "sensor",
    effects: Sequence[Effect] | None = None,
    warm_up: float = 240.0,
    seed: int = 0,
    workers: int = 1,
    scheduler: str | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose the gap between a recording and its system's model.

    Parameters
    ----------
    run
        Folder of an estimator, whose zero-shot estimate is the first start; without, the middle of the prior is.
    out
        Folder for ``report.json`` and the page ``report.html``, written when all is done.
    replay
        The recorded actuators replace the model's control loops.
    occupancy
        ``measured`` or ``unknown``; measured where the recording has it, if not given.
    noise
        A noise preset of the description.
    effects
        Candidates; those of the description and of installed packages if not given.
    warm_up
        The recording's first day is repeated this long before its start [h].
    seed
        Of twins, placebos and bootstraps.
    workers, scheduler
        Processes on this machine, or the address of a Dask scheduler, for the simulations.
    tell
        Is told what is being done.

    Raises
    ------
    RecordingError
        If the recording is shorter than a day or does not fit the system.
    SystemDescriptionError, FmuError, SimulationError, EstimatorError
        If the system, its effects, its FMU or the estimator cannot be used.
    """
    began, used = time.perf_counter(), time.process_time()
    described = system if isinstance(system, System) else load_system(system)
    record = recording if isinstance(recording, Recording) else read_recording(recording, described)
    check_recording(record, described)
    described = described.with_experiment(step=record.step, hours=len(record.time) * record.step / HOUR)
    candidates = list(effects) if effects is not None else library(described)
    simulator = Simulator(described)
    with side_by_side(simulator, workers=workers, scheduler=scheduler) as runner:
        whole = Problem(
            simulator,
            record,
            noise=noise,
            occupancy=occupancy,
            replay=replay,
            warm_up=warm_up * HOUR,
            runner=runner,
        )
        scored = kept_for_scoring(record)
        fitted = whole.observed & ~scored
        tell("fitting the base model")
        base = fit(whole.with_observed(fitted), _starts(whole, run, record, described, seed), rounds=ROUNDS)
        found = search(base, candidates, fitted, whole.floor, seed=seed, tell=tell)
        first = found.stages[0]
        tell("finding where the gap lies")
        sources = operators(first.lin.problem, first.lin.z, first.lin.around.heights, [*first.lin.effects])
        where = place(first, whole.observed, sources)
        if found.chosen and not gap_found(first, where.p_value):
            found = replace(found, stages=[first], refits=[])
        where_left = place(found.last, whole.observed, []) if found.chosen else None
        decision = decide(found, where.p_value, where_left.p_value if where_left is not None else where.p_value)
        shrinkage = []
        if found.chosen:
            tell("scoring on the part that was kept")
            shrinkage = shrinkages(first, found.last, found.last.colours, scored, whole.observed, seed=seed)
        simulations = base.simulations + found.simulations + first.lin.problem.simulations
    from diagnosis.gap.reporting import reported

    report = reported(
        base=base,
        search=found,
        decision=decision,
        where=where,
        where_left=where_left,
        shrinkage=shrinkage,
        scored=scored,
        seed=seed,
        simulations=simulations,
        seconds=time.perf_counter() - began,
        cpu_seconds=time.process_time() - used,
    )
    done = Diagnosis(report, base, found, decision, where, where_left, shrinkage, scored)
    if out is not None:
        from diagnosis.gap.page import write_report

        tell("writing the report")
        write_report(done, Path(out))
    return done


def _starts(problem: Problem, run: Path | str | None, record: Recording, system: System, seed: int) -> list[np.ndarray]:
    """An estimator's estimate; without one the middle of the prior, and draws from it."""
    if run is not None:
        return [problem.unknowns(estimate(run, record, system))]
    others = np.random.default_rng(seed).standard_normal((STARTS - 1, problem.size))
    return [np.zeros(problem.size), *others]
