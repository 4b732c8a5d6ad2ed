"""The whole diagnosis of one recording: where the gap lies, which effect causes it, how far it shrinks."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.checks import opened
from diagnosis.effects import Effect, library
from diagnosis.effects.baselines import check_baselines
from diagnosis.effects.edges import foreseen
from diagnosis.fitting.fit import Fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.run import Run
from diagnosis.fitting.side_by_side import InProcess, Outcome, Runner, side_by_side
from diagnosis.gap.apart import Apart, fitted_apart
from diagnosis.gap.conditions import Otherwise, otherwise
from diagnosis.gap.decision import Decision, decide, gap_found
from diagnosis.gap.exchange import exchanged
from diagnosis.gap.limits import noiseless
from diagnosis.gap.linear import applicable
from diagnosis.gap.missing import operators
from diagnosis.gap.parts import kept_for_scoring
from diagnosis.gap.places import check_places, place
from diagnosis.gap.schema import Report
from diagnosis.gap.search import Search, at_its_optimum, search
from diagnosis.gap.shrinkage import Shrinkage, shrinkages
from diagnosis.gap.starting import Begun, begun, zero_shot
from diagnosis.recording import HOUR, Recording
from diagnosis.where import Operator, Where
from shared.errors import RecordingError
from shared.places import check_folder
from shared.system import System


class _Held:
    """A runner that can be exchanged in all problems that have it: processes end with the diagnosis they ran for."""

    def __init__(self, runner: Runner) -> None:
        self.runner = runner

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`diagnosis.fitting.side_by_side.Runner`."""
        return self.runner.map(runs)


@dataclass(frozen=True)
class Diagnosis:
    """A diagnosis and all that it was made from.

    ``whole`` is the problem before any fit; ``scored`` (steps,) the part that ``apart``'s fits do without; ``sources``
    the operators of what may be missing from a balance, and ``unknown`` why there are no others; ``otherwise``: better
    conditions than the recording's; ``where_left`` is with the chosen effects, if there are any.
    """

    report: Report
    whole: Problem
    origin: Begun
    candidates: list[Effect]
    search: Search
    decision: Decision
    sources: list[Operator]
    unknown: dict[str, str]
    otherwise: list[Otherwise]
    where: Where
    where_left: Where | None
    apart: Apart | None
    shrinkage: list[Shrinkage]
    scored: np.ndarray
    seed: int

    def without(self, names: Collection[str], tell: Callable[[str], None] = lambda _: None) -> Diagnosis:
        """The same recording diagnosed with some candidates withheld, as :func:`diagnose` would have done.

        The fit of the base model, the sensitivities and what is missing from the balances are kept; colours, twins,
        scan and decision are made anew, and refits that were not made yet.
        """
        left = [one for one in self.candidates if one.name not in names]
        clock = time.perf_counter(), time.process_time()
        return _concluded(self.whole, self.origin, left, self.scored, self.seed, clock, tell, self)

    @property
    def base(self) -> Fit:
        """The base model's fit."""
        return self.origin.fit


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
        Folder of an estimator, whose zero-shot estimate is the first start; without, the estimator beside the system
        description is asked, if there is one that can read the recording. The middle of the prior is a further start.
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
        The recording's first day is repeated this long before its start [h], at least a step.
    seed
        Of twins, placebos and bootstraps.
    workers, scheduler
        Processes on this machine, or the address of a Dask scheduler, for the simulations.
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
    described, record = opened(system, recording, noise=noise, warm_up=warm_up)
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
        done = _concluded(whole, origin, candidates, scored, seed, (began, used), tell)
    held.runner = InProcess(simulator)
    if out is not None:
        from diagnosis.gap.page import write_report

        tell("writing the report")
        write_report(done, Path(out))
    return done


def _concluded(
    whole: Problem,
    origin: Begun,
    candidates: list[Effect],
    scored: np.ndarray,
    seed: int,
    clock: tuple[float, float],
    tell: Callable[[str], None],
    known: Diagnosis | None = None,
) -> Diagnosis:
    """What follows from the base model's fit; ``clock`` is when the diagnosis began: wall and processor time [s]."""
    from diagnosis.gap.reporting import reported

    base = origin.fit
    found = search(
        base,
        candidates,
        whole.observed,
        whole.floor,
        begin=origin.start,
        seed=seed,
        tell=tell,
        known=None if known is None else known.search,
    )
    found = exchanged(found, candidates, whole.observed, whole.floor, seed=seed, tell=tell)
    found = at_its_optimum(found)
    first = found.stages[0]
    tell("finding where the gap lies")
    problem = first.lin.problem
    counted = problem.simulations
    if known is None:
        sources, unknown = operators(problem, first.lin.z, first.lin.around.heights)
        spent = -whole.simulations
        better = otherwise(first, whole, candidates)
        spent += whole.simulations
    else:
        sources, unknown, better, spent = known.sources, known.unknown, known.otherwise, 0
    where = place(first, whole.observed, sources)
    if found.chosen and not gap_found(first, where.p_value, found.confirmed):
        found = replace(found, stages=[first], refits=[], settled=[])
    where_left = place(found.last, whole.observed, []) if found.chosen else None
    decision = decide(found, where.p_value, where_left.p_value if where_left is not None else where.p_value)
    apart, shrinkage = None, []
    if found.chosen and (whole.observed & ~scored).any():
        tell("scoring on a part that is kept from the fit")
        apart = fitted_apart(found, whole.observed & ~scored)
        spent += apart.simulations
        shrinkage = shrinkages(apart, first, found.last.colours, scored, whole.observed, seed=seed)
    report = reported(
        base=base,
        started_from=origin.name,
        search=found,
        decision=decision,
        where=where,
        where_left=where_left,
        shrinkage=shrinkage,
        agreed=apart is None or apart.agreed,
        otherwise=better,
        unknown=unknown,
        scored=scored,
        seed=seed,
        simulations=(base.simulations if known is None else 0)
        + found.simulations
        + problem.simulations
        - counted
        + spent,
        seconds=time.perf_counter() - clock[0],
        cpu_seconds=time.process_time() - clock[1],
    )
    report = report.model_copy(update={"limits": [*report.limits, *noiseless(whole.undeclared)]})
    return Diagnosis(
        report,
        whole,
        origin,
        candidates,
        found,
        decision,
        sources,
        unknown,
        better,
        where,
        where_left,
        apart,
        shrinkage,
        scored,
        seed,
    )
