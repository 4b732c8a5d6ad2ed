"""The whole diagnosis of one recording: where the gap lies, which effect causes it, how far it shrinks.

The base model's fit, from where a diagnosis begins: an estimator's zero-shot estimate, and the middle of the prior.

Two rounds from the middle of the prior end hundreds in log evidence below the optimum where the controllers are
simulated, and what is left looks like a gap; from an estimate they reach it. But an estimate knows no gap, and a
recording that has one may fit better from elsewhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibration import opened
from diagnosis.curves import curves, plot
from diagnosis.effects import Effect, library
from diagnosis.effects.base import foreseen
from diagnosis.effects.library import check_baselines
from diagnosis.fitting.failures import FAILURES, NO_TIME, reason
from diagnosis.fitting.fit import Fit, fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.simulations import side_by_side, simulations
from diagnosis.gap.evidence import Evidence, Search, evidence_of, gap_found
from diagnosis.gap.limits import Otherwise, ends_left_out, noiseless, otherwise
from diagnosis.gap.linear import applicable
from diagnosis.gap.places import check_places, operators, place
from diagnosis.gap.reporting import reported
from diagnosis.gap.schema import HOW_FAR, Report
from diagnosis.gap.search import at_its_optimum, search
from diagnosis.gap.shrinkage import Apart, Shrinkage, fitted_apart, kept_for_scoring, left_by, shrinkages
from diagnosis.gap.verdict import Decision, Verdicts, decide, verdicts_of
from diagnosis.physics import check_physics
from diagnosis.recording import HOUR, Recording
from diagnosis.usual import WARM_UP
from diagnosis.where import Operator, Where
from diagnosis.zero_shot import estimate
from shared.errors import EstimatorError, RecordingError, SimulationError, TimeUp
from shared.places import check_folder
from shared.results import Result
from shared.shipped import estimator_beside
from shared.stretches import Stretch
from shared.system import System

QUIET = 1.25
"""Mean square of the standardised residual up to which a fit has nothing to gain from another start."""
PRIOR = "prior"
ROUNDS = 2
"""Of the fits of a diagnosis: refits go on from there."""
RESTLESS = 4
"""Rounds more of the fits of a diagnosis, while the unknowns still move far: then a fit says nothing yet."""


@dataclass(frozen=True)
class Begun:
    """The base model's fit, and where it began: ``name``, and unknowns ``start`` (unknowns of the fit,)."""

    fit: Fit
    name: str
    start: np.ndarray


@dataclass(frozen=True)
class ZeroShot:
    """An estimator's estimate: values by name [unit of the description], and the estimator's folder."""

    values: dict[str, float]
    folder: str


def zero_shot(
    system: System, recording: Recording, run: Path | str | None, tell: Callable[[str], None]
) -> ZeroShot | None:
    """What an estimator says of a recording; None where there is no estimator that can read it.

    Parameters
    ----------
    run
        Folder of an estimator; without, the one beside the system description.

    Raises
    ------
    EstimatorError, RecordingError
        If the estimator that was given cannot read the recording.
    """
    folder = run if run is not None else estimator_beside(system.path)
    if folder is None:
        return None
    try:
        return ZeroShot(estimate(folder, recording, system), str(folder))
    except (EstimatorError, RecordingError) as error:
        if run is not None:
            raise
        tell(f"without a zero-shot estimate: {error}")
        return None


def begun(problem: Problem, estimated: ZeroShot | None) -> Begun:
    """The most plausible fit of the base model, begun at the estimator's estimate or at the middle of the prior.

    Where the time is up after one of them, that is it.

    Parameters
    ----------
    problem
        Before any fit, without effects.
    estimated
        From :func:`zero_shot`.

    Raises
    ------
    SimulationError
        If simulation or algebra fail at every start.
    TimeUp
        If the time was up before there was a fit.
    """
    starts = [(PRIOR, np.zeros(problem.size))]
    if estimated is not None:
        starts.insert(0, (estimated.folder, problem.unknowns(estimated.values)))
    best: Begun | None = None
    why: dict[str, str] = {}
    for name, start in starts:
        try:
            found = fit(problem.with_effects(()), [start], rounds=ROUNDS, restless=RESTLESS)
        except FAILURES as error:
            why[name] = reason(error)
            continue
        except TimeUp:
            if best is None:
                raise
            break
        if best is None or found.log_evidence > best.fit.log_evidence:
            best = Begun(found, name, start)
        if 2 * best.fit.cost < QUIET * len(best.fit.residual):
            break
    if best is None:
        said = "; ".join(f"from {name}: {one}" for name, one in why.items())
        raise SimulationError(
            f"{problem.recording.path}: the base model cannot be fitted to it ({said}); expected a start at which it"
            " can be simulated. `diagnosis residuals` with --set tells which parameters can"
        )
    return best


SOURCES = "what the balances may lack"


@dataclass(frozen=True)
class Began:
    """When a diagnosis began: wall and processor time [s], and the simulations that had been asked for until then."""

    seconds: float
    cpu_seconds: float
    simulations: int

    @classmethod
    def now(cls, simulations: int) -> Began:
        """At this moment."""
        return cls(time.perf_counter(), time.process_time(), simulations)


@dataclass(frozen=True, repr=False)
class Diagnosis(Result):
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
    evidence: Evidence
    by: tuple[Verdicts, str]
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
        """The same recording diagnosed with some candidates withheld.

        The readings that count (a clock takes some from the ends), the fit of the base model, the sensitivities and
        what is missing from the balances are kept; colours, twins, scan and decision are made anew, and refits that
        were not made yet.
        """
        left = [one for one in self.candidates if one.name not in names]
        began = Began.now(self.whole.simulations)
        return concluded(self.whole, self.origin, left, self.scored, self.seed, began, self.by, tell, self)

    @property
    def base(self) -> Fit:
        """The base model's fit."""
        return self.origin.fit

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        return self.report.headline

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each candidate: its probability, and its size with the 90 % interval if it was fitted."""
        return self.report.to_dataframe()

    def plot(self) -> Figure:
        """Measured, the base model, and the model with the chosen effects, output by output."""
        return plot(self.curves())

    def curves(self) -> xr.Dataset:
        """What was measured, the base model, and the model with the chosen effects if there are any."""
        first, last, record = self.search.stages[0], self.search.last, self.whole.recording
        before, after = first.twins.residual, None
        if last.lin.chosen:
            after = record.outputs - left_by(last.lin, last.colours, self.whole.observed)
        system = self.whole.system
        return curves(
            record.time,
            record.zero,
            system.outputs,
            measured=record.outputs,
            before=record.outputs - before,
            after=after,
        )


def concluded(
    whole: Problem,
    origin: Begun,
    candidates: list[Effect],
    scored: np.ndarray,
    seed: int,
    began: Began,
    by: tuple[Verdicts, str],
    tell: Callable[[str], None],
    known: Diagnosis | None = None,
) -> Diagnosis:
    """What follows from the base model's fit.

    Parameters
    ----------
    scored
        The part that is kept from the fits that say how far the gap shrinks, shape (steps,).
    began
        When the diagnosis began.
    by
        How evidence becomes an answer, from :func:`diagnosis.gap.verdict.verdicts_of`.
    known
        A diagnosis from the same fit among these candidates and others; what does not depend on the others is kept.
    """
    base = origin.fit
    cut = whole.runner.time_up
    found = search(
        base,
        candidates,
        whole.observed,
        begin=origin.start,
        seed=seed,
        tell=tell,
        known=None if known is None else known.search,
    )
    if cut:
        found.unfinished.why = {"the base model's fit to its end": NO_TIME, **found.unfinished.why}
    attempt = found.unfinished.attempt
    found = attempt("the optimum with the chosen effects", lambda: at_its_optimum(found), found)
    first = found.stages[0]
    tell("finding where the gap lies")
    problem = first.lin.problem
    sources: list[Operator] = []
    unknown: dict[str, str] = {}
    better: list[Otherwise] = []
    # with fewer candidates the base model's fit may not have gone on, and lie elsewhere
    if known is None or not np.array_equal(known.search.stages[0].lin.z, first.lin.z):
        heights = first.lin.around.heights
        sources, unknown = attempt(SOURCES, lambda: operators(problem, first.lin.z, heights), (sources, unknown))
        better = attempt("what could be seen otherwise", lambda: otherwise(first, whole, candidates), better)
    else:
        sources, unknown, better = known.sources, known.unknown, known.otherwise
    where = attempt(SOURCES, lambda: place(first, whole.observed, sources), None) or place(first, whole.observed, [])
    where_left = None
    if found.chosen:
        where_left = attempt("what is left, and where", lambda: place(found.last, whole.observed, []), None)
    left = gap_found(found.last, (where_left or where).p_value)
    evidence = evidence_of(found, gap_found(first, where.p_value, found.confirmed), left, where.p_value)
    decision = decide(evidence, by[0])
    if found.chosen and decision.verdict == "no_gap":
        dropped = tuple(one.name for one in found.chosen)
        found, where_left = replace(found, stages=[first], refits=[], settled=[], dropped=dropped), None
    apart: Apart | None = None
    shrinkage: list[Shrinkage] = []
    if found.chosen and (whole.observed & ~scored).any():
        tell("scoring on a part that is kept from the fit")
        apart = attempt(HOW_FAR, lambda: fitted_apart(found, whole.observed & ~scored), None)
    if apart is not None:
        done, colours = apart, found.last.colours
        shrinkage = attempt(
            HOW_FAR, lambda: shrinkages(done, first, colours, scored, whole.observed, seed=seed), shrinkage
        )
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
        simulations=whole.simulations - began.simulations,
        seconds=time.perf_counter() - began.seconds,
        cpu_seconds=time.process_time() - began.cpu_seconds,
        by=by[0],
        uncalibrated=by[1],
    )
    ends = ends_left_out(whole.observed, np.isfinite(whole.measured), whole.recording.step / HOUR)
    more = [*ends, *noiseless(whole.undeclared)]
    report = report.model_copy(update={"limits": [*report.limits, *more]})
    return Diagnosis(
        report,
        whole,
        origin,
        candidates,
        found,
        decision,
        evidence,
        by,
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


SPANS = {
    "fitting the base model": (0.0, 0.1),
    "sensitivities": (0.1, 0.2),
    "leading": (0.2, 0.3),
    "looking at all": (0.3, 0.4),
    "refitting": (0.4, 0.7),
    "finding where": (0.7, 0.8),
    "scoring": (0.8, 0.99),
    "writing": (0.99, 1.0),
}
"""By the first words of what is told: between which shares of a diagnosis it is, roughly. Only the time left that is
told follows from them, and where a stage is left out there is less of it."""


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
    tell: Callable[[str], None] = lambda _: None,
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
    tell
        Is told what is being done when that changes and every half minute, and roughly how long it will still take.

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
    if out is not None:
        check_folder(Path(out), RecordingError)
    described, record = opened(
        system, recording, noise=noise, warm_up=warm_up, replay=replay, occupancy=occupancy, stretch=stretch
    )
    tell("holding the recording against physics")
    physics = check_physics(described, record)
    candidates = list(effects) if effects is not None else library(described)
    estimated = zero_shot(described, record, run, tell)
    simulator = Simulator(described)
    check_baselines(candidates, described, simulator.fmu, replay=replay)
    by = verdicts_of(described, library(described), simulator.fmu.sha256, noise)
    place = None if out is None else Path(out)
    with (
        side_by_side(simulator, workers=workers, scheduler=scheduler) as runner,
        simulations(runner, place, simulator, record, minutes=minutes, tell=tell) as made,
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

        def told(stage: str) -> None:
            made.tell(stage, *next((span for words, span in SPANS.items() if stage.startswith(words)), ()))

        told("fitting the base model")
        origin = begun(whole, estimated)
        done = concluded(whole, origin, candidates, scored, seed, began, by, told)
        done = replace(done, report=done.report.model_copy(update={"physics": physics}))
        if place is not None:
            from diagnosis.gap.page import write_report

            told("writing the report")
            write_report(done, place)
    return done
