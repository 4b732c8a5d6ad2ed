"""The report's tables and sentences, from what the diagnosis found."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.fit import doubted_sd
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import Refit
from diagnosis.fitting.starting import Begun
from diagnosis.gap.evidence import Evidence, Search
from diagnosis.gap.limits import detectability, ends_left_out, limits, noiseless, strained
from diagnosis.gap.places import stretch
from diagnosis.gap.rivals import Rivals
from diagnosis.gap.schema import (
    CalibratedBy,
    HypothesisOf,
    NamedEffect,
    NoiseOf,
    ParameterOf,
    Place,
    Report,
    ShrinkageOf,
    SourceOf,
    StageOf,
)
from diagnosis.gap.sentences import summary
from diagnosis.gap.shrinkage import Apart
from diagnosis.gap.stages import Stage
from diagnosis.gap.twins import TWINS
from diagnosis.gap.verdict import Decision
from diagnosis.recording import HOUR
from diagnosis.usual import HALF_WIDTH
from diagnosis.verdicts import Verdicts
from diagnosis.where import Operator, Where


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


@dataclass(frozen=True)
class Answered:
    """What a diagnosis found, and what it was found from.

    ``whole`` is the problem before any fit; ``scored`` (steps,) the part that ``apart``'s fits do without; ``sources``
    the operators of what may be missing from a balance, and ``unknown`` why there are no others; ``where_left`` is with
    the chosen effects, if there are any.
    """

    whole: Problem
    origin: Begun
    candidates: list[Effect]
    search: Search
    decision: Decision
    evidence: Evidence
    by: tuple[Verdicts, str]
    sources: list[Operator]
    unknown: dict[str, str]
    where: Where
    where_left: Where | None
    apart: Apart | None
    shrinkage: list[ShrinkageOf]
    scored: np.ndarray
    seed: int


def reported(done: Answered, began: Began) -> Report:
    """All tables of ``report.json``."""
    search, decision, where, (by, uncalibrated) = done.search, done.decision, done.where, done.by
    problem, first = search.base.lin.problem, search.stages[0]
    long = {one.name: one.long_name for one in problem.system.outputs}
    report = Report(
        verdict=decision.verdict,
        summary=[],
        effects=_effects(search, decision, by.doubt),
        hypotheses=_hypotheses(search),
        sets=[list(one) for one in decision.sets],
        none_of_these=decision.none,
        no_gap=decision.nothing,
        mistaken=decision.mistaken,
        or_none=decision.or_none,
        possible=list(decision.possible),
        gap=decision.gap,
        rejected=decision.rejected,
        unlike=decision.unlike,
        where=_places(where, first, dict(zip(problem.system.output_names, problem.floor.tolist(), strict=True))),
        balance=where.verdict if decision.verdict != "no_gap" else "none",
        sources=_sources(where),
        sources_unknown=done.unknown,
        shrinkage=done.shrinkage,
        chosen_apart=done.apart is None or done.apart.agreed,
        parameters=_before_and_after(search, 0, [(one.name, one.unit) for one in problem.system.parameters], by.doubt),
        constants=_before_and_after(
            search, len(problem.system.parameters), [(one.name, "1") for one in problem.constants], by.doubt
        ),
        detectability=detectability(first),
        dropped=list(search.dropped),
        excluded={name: why for name, why in search.excluded.items() if name not in first.lin.failed},
        failed={**first.lin.failed, **search.failed},
        unfinished=search.unfinished.why,
        stages=_stages(search, where, done.where_left),
        noise=_noise(first),
        limits=[],
        system=problem.system.name,
        wider=problem.system.wider,
        system_hash=problem.system.hash(),
        fmu_sha256=problem.simulator.fmu.sha256,
        recording=str(problem.recording.path),
        zero=str(problem.recording.zero),
        start=problem.recording.start,
        steps=len(problem.time),
        step=problem.recording.step,
        fitted_share=float(1 - done.scored.mean()),
        occupancy=problem.occupancy,
        replay=problem.replay,
        replayed=list(problem.drive.replayed),
        assumed=problem.drive.assumed,
        twins=TWINS,
        seed=done.seed,
        started_from=done.origin.name,
        converged=search.base.settled,
        converged_after=search.settled[-1].settled if search.chosen else None,
        simulations=done.whole.simulations - began.simulations,
        seconds=time.perf_counter() - began.seconds,
        cpu_seconds=time.process_time() - began.cpu_seconds,
        calibrated=CalibratedBy.model_validate(by, from_attributes=True),
        uncalibrated=uncalibrated,
    )
    limited = limits(report) + strained(report, {one.name: one.relative for one in problem.constants})
    whole = done.whole
    limited += ends_left_out(whole.observed, np.isfinite(whole.measured), whole.recording.step / HOUR)
    limited += noiseless(whole.undeclared)
    return report.model_copy(update={"summary": summary(report, sensors_among(first), long), "limits": limited})


def sensors_among(first: Stage) -> set[str]:
    """Names of the candidates that are errors of a sensor: they touch what is shown of an output."""
    return {one.name for one in first.lin.effects if any(what.startswith("output:") for what in one.changes)}


def _by_name(rivals: Rivals | None) -> dict[str | None, Refit]:
    """Refits by their candidate, the base model's by None."""
    if rivals is None:
        return {}
    found: dict[str | None, Refit] = {one.names[0]: one for one in rivals.refits}
    return found | {None: rivals.base}


def _hypotheses(search: Search) -> list[HypothesisOf]:
    """The base model first, then candidates in the order of their evidence where they were asked last."""
    stage = search.stages[0]
    known = search.made.rivals.get(replace(search, stages=[stage]).path)
    start = _by_name(None if known is None else known[1])
    best = _by_name(search.compared)

    def of(name: str | None, on_line: float) -> HypothesisOf:
        first, last = start.get(name), best.get(name)
        return HypothesisOf(
            name=name,
            on_line=on_line,
            at_start=None if first is None else first.evidence,
            at_best=None if last is None else last.evidence,
            amplitude=None if last is None or name is None else float(last.lin.amplitudes[0]),
        )

    def rank(one: HypothesisOf) -> list[float]:
        return [-np.inf if value is None else value for value in (one.at_best, one.at_start, one.on_line)]

    evidence = zip(stage.lin.effects, stage.scan.evidence.tolist(), strict=True)
    return [of(None, 0.0), *sorted((of(effect.name, value) for effect, value in evidence), key=rank, reverse=True)]


def _effects(search: Search, decision: Decision, doubt: float) -> list[NamedEffect]:
    """Candidates, the most probable first."""
    fitted: dict[str, tuple[float, float, bool]] = {}
    for k, refits in enumerate(search.refits):
        told = decision.sets[k] if k < len(decision.sets) else ()
        for one in reversed(refits):
            name = one.names[-1]
            if name in told or name not in fitted:  # a candidate of an earlier set is told as what it was there
                fitted[name] = _amplitude(one, name, doubt)
    for name in search.settled[-1].names if search.settled else ():  # chosen together, fitted together
        fitted[name] = _amplitude(search.settled[-1], name, doubt)
    found = []
    for effect in search.stages[0].lin.effects:
        known = fitted.get(effect.name)
        found.append(
            NamedEffect(
                name=effect.name,
                description=effect.description,
                kind=effect.kind,
                probability=decision.probabilities.get(effect.name, 0.0),
                named=effect.name in decision.named,
                amplitude=None if known is None else known[0] * effect.scale,
                low=None if known is None else max((known[0] - HALF_WIDTH * known[1]) * effect.scale, effect.lower),
                high=None if known is None else min((known[0] + HALF_WIDTH * known[1]) * effect.scale, effect.upper),
                unit=effect.unit,
                at_bound=known is not None and known[2],
            )
        )
    return sorted(found, key=lambda one: -one.probability)


def _amplitude(one: Refit, name: str, doubt: float) -> tuple[float, float, bool]:
    """Of one of a refit's effects: amplitude and standard deviation [scales], and whether it lies on a bound."""
    place = len(one.lin.problem.system.parameters) + one.names.index(name)
    z, sd = float(one.lin.z[place]), float(_sd(one, doubt)[place])
    low, high = (bound[place] for bound in one.lin.problem.bounds)
    # zero is the base model and no bound; of a range that is open on one side the other end counts
    ends = [end for end in (low, high) if np.isfinite(end) and end != 0]
    near = 0.01 * (high - low if np.isfinite(high - low) else max(map(abs, ends), default=0.0))
    return z, sd, any(abs(z - end) <= near for end in ends)


def _places(where: Where, first: Stage, noise: dict[str, float]) -> list[Place]:
    """Findings, the surest first; equally sure ones by their size in units of the channel's noise.

    What stood out once comes after cells that are as sure, which do so again and again.
    """
    once, again = stretch(first), any(one.kind == "cell" for one in where.findings)
    found = [Place.model_validate(one, from_attributes=True) for one in where.findings + once]

    def rank(one: Place) -> tuple[float, float]:
        alike = one.kind in ("cell", "episode") and one.channel in noise
        alike = alike and not (again and one.cell.get("statistic") == "offset")
        return one.p_value, -abs(one.size) / noise[one.channel] if alike else 0.0

    return sorted(found, key=rank)


def _before_and_after(search: Search, first: int, names: list[tuple[str, str]], doubt: float) -> list[ParameterOf]:
    """Before, and after if effects were chosen, with 90 % intervals [unit]; (name, unit) of unknowns from ``first`` on.

    Amplitudes stand between parameters and constants, and only after.
    """
    one = search.base
    before, bounds = _values(one, doubt), set(one.at_bound)
    after, bounds_after, shift = None, set[str](), 0
    if search.chosen:
        one = search.settled[-1]
        after, bounds_after = _values(one, doubt), set(one.at_bound)
        shift = len(search.chosen) if first else 0
    found = []
    for k, (name, unit) in enumerate(names, first):
        later = [None] * 3 if after is None else [float(values[k + shift]) for values in after]
        found.append(
            ParameterOf(
                name=name,
                unit=unit,
                before_low=float(before[0][k]),
                before=float(before[1][k]),
                before_high=float(before[2][k]),
                after_low=later[0],
                after=later[1],
                after_high=later[2],
                at_bound=name in bounds,
                at_bound_after=name in bounds_after,
            )
        )
    return found


def _values(one: Refit, doubt: float) -> list[np.ndarray]:
    """Values and their 90 % intervals (low, value, high), each (unknowns,) [unit of each]."""
    return [one.lin.problem.values(one.lin.z + k * HALF_WIDTH * _sd(one, doubt)) for k in (-1, 0, 1)]


def _sd(one: Refit, doubt: float) -> np.ndarray:
    """Standard deviations (unknowns,) of a refit, its recording doubted as a calibration's is."""
    return np.asarray(doubted_sd(one.sd / one.grams.spread, doubt) * one.grams.spread)


def _sources(where: Where) -> list[SourceOf]:
    return [
        SourceOf(
            name=one.name,
            description=one.label,
            unit=one.unit,
            mean=float(one.estimate.mean()),
            peak=float(one.estimate[np.argmax(np.abs(one.estimate))]),
            gain=one.gain,
            p_value=one.p_value,
            rival=one.rival,
            balance=one.balance,
            verdict=one.verdict,
        )
        for one in (where.sources.sources if where.sources is not None else [])
    ]


def _stages(search: Search, where: Where, where_left: Where | None) -> list[StageOf]:
    found = []
    for k, stage in enumerate(search.stages):
        best = stage.scan.foremost
        some = stage.scan.evidence.max(initial=0.0) > 0
        strongest = int(np.argmax(stage.scan.evidence)) if some else None
        p = where.p_value if k == 0 else where_left.p_value if where_left and k == len(search.stages) - 1 else None
        found.append(
            StageOf(
                effects=[one.name for one in stage.lin.chosen],
                best=stage.scan.effects[best].name if best is not None else None,
                strongest=stage.scan.effects[strongest].name if strongest is not None else None,
                ratio=float(stage.scan.ratio[best]) if best is not None else 0.0,
                evidence=float(stage.scan.evidence.max(initial=0.0)),
                p_value=stage.scan.p_value,
                misfit_p=stage.scan.misfit_p,
                where_p=p,
                episode_p=stage.episode.p_value if stage.episode else None,
                left_over=stage.left_over,
            )
        )
    return found


def _noise(first: Stage) -> list[NoiseOf]:
    names = first.lin.problem.system.output_names
    found = []
    for k, (white, slow, memory) in first.colours.best.items():
        size = float(np.hypot(white, slow))
        hours = memory / HOUR if slow > 0 else 0.0
        found.append(NoiseOf(channel=names[k], size=size, slow_share=float((slow / size) ** 2), hours=hours))
    return found
