"""One recording of the farm: its cause drawn, lived and measured, and what the diagnosis makes of it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from datagen.driving.sampling import record_start, stream
from diagnosis.blind.generator import Case, Cause, Generator, Made, measured, published, write
from diagnosis.blind.truth import Measuring, Strata, Truth
from diagnosis.effects import Effect, clash, library
from diagnosis.farming.laws import EXACT, Process, Span, Warped, course, outside, warped
from diagnosis.gap.evidence import Evidence
from diagnosis.recording import HOUR
from shared.errors import RecordingError, SimulationError
from shared.system import System

STRATA = {"none": 0.4, "listed": 0.34, "two": 0.08, "withheld": 0.08, "outside": 0.1}
"""How often a recording has no cause, a candidate's, two candidates', one of a candidate that the diagnosis is not
given, or one that no candidate describes."""
AMPLITUDES = (0.25, 4.0)
"""Of a candidate's cause, log-uniform [its scales]."""
GAPS = (0.5, 6.0)
"""Root mean square that a cause outside the library makes at the most touched output, log-uniform [its noise]."""
BACKGROUND = (0.05, 0.5)
"""The same of a process that every room has beside its cause: no building is as its model, and that is no gap. A cause
that does less than the least of it is none."""
MOST = 5.0
"""Greatest amplitude of a process [spreads of what it is added to]."""
UNKNOWN, REPLAY = 0.5, 0.35
"""How often persons are not counted, and actuators replayed."""
MEASURING = {"slow": 0.3, "hours": (2.0, 12.0)}
"""Share of a sensor's variance that is slow, and over how many hours."""
STEP = 600.0
"""Of the rooms' own record, where it is a part of the recordings' [s]."""
ATTEMPTS = 5
"""Draws of a recording that cannot be simulated."""


@dataclass(frozen=True)
class Row:
    """What a recording of the farm was, and what the diagnosis found.

    ``stratum`` is one of :data:`STRATA`; ``true``: candidates that are causes; ``withheld``: the one that the diagnosis
    was not given; ``gap``: root mean square of what the causes do at the most touched output [its noise]; ``errors`` by
    parameter, with the effects that were chosen: estimate minus truth, and the standard deviation that the fit gives
    it [standard deviations of its prior].
    """

    index: int
    stratum: str
    true: tuple[str, ...]
    withheld: str
    gap: float
    evidence: Evidence
    errors: tuple[tuple[float, float], ...]
    cpu_seconds: float
    simulations: int


@dataclass(frozen=True)
class Rows:
    """Rows in the order of their numbers, and what they are of (``about``): system, seed, length, and the like."""

    about: dict[str, Any]
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Drawn:
    """A recording before it is simulated: its case, and what :class:`Row` says of it.

    ``background`` acts beside the case's causes, and ``outside``, if there is one, is a cause itself: each process so
    that it alone makes a gap of that size.
    """

    case: Case
    stratum: str
    background: tuple[Process, float]
    outside: tuple[Process, float] | None = None
    true: tuple[str, ...] = ()
    withheld: str = ""


def generator(system: System, hours: float, noise: str) -> Generator:
    """What lets rooms of a system be lived in and measured, by the system's own FMU."""
    own = system.experiment.step
    truth = Truth(
        system=system.name,
        fmu=str(system.fmu_path.resolve()),
        step=STEP if own % STEP == 0 else own,
        tolerance=1e-7,
        amplitudes=AMPLITUDES,
        strata=Strata(none=1, library=0, form=0, two=0, outside=0),
        measuring=Measuring(noise=noise, unknown_occupancy=UNKNOWN, replay=REPLAY, **MEASURING),
        path=system.path,
    )
    return Generator(system, truth, hours=hours)


def draw(made_by: Generator, seed: int, index: int, attempt: int) -> Drawn:
    """Which recording a number stands for: it depends on (seed, index, attempt) alone."""
    system, noise = made_by.system, made_by.truth.measuring.noise
    rng, fixed = stream(seed, index, f"farm.{attempt}"), stream(seed, index, "farm.conditions").random(3)
    stratum = _one_of(STRATA, fixed[0])
    replay = bool(fixed[1] < REPLAY) and any(one.source == "measured" for one in system.inputs)
    unknown = bool(fixed[2] < UNKNOWN)
    case = Case(seed, index, stratum, (), unknown, replay, attempt)
    start = record_start(system, case.root, index)
    span = Span(start - system.experiment.warm_up_hours * HOUR, start, start + made_by.hours * HOUR)

    def sized(sizes: tuple[float, float]) -> tuple[Process, float]:
        return outside(system, rng, span, noise, unknown=unknown), float(np.exp(rng.uniform(*np.log(sizes))))

    background = sized(BACKGROUND)
    if stratum == "outside":
        return Drawn(case, stratum, background, sized(GAPS))
    effects = [one for one in made_by.effects if _acts(one, replay)]
    if stratum == "none" or not effects:
        return Drawn(case, "none", background)
    effect = effects[int(rng.integers(len(effects)))]
    causes = [_cause(effect, system, rng, span)]
    partners = [one for one in effects if one is not effect and not clash([effect, one])]
    if stratum == "two" and partners:
        causes.append(_cause(partners[int(rng.integers(len(partners)))], system, rng, span))
    case = _with(case, *causes)
    if stratum == "withheld":
        return Drawn(case, stratum, background, withheld=effect.name)
    return Drawn(case, stratum, background, true=tuple(one.label for one in causes))


def _cause(effect: Effect, system: System, rng: np.random.Generator, span: Span) -> Cause:
    """A candidate's cause of random size, by a law of its own or by the candidate's."""
    low, high = np.log(AMPLITUDES)
    size = float(np.exp(rng.uniform(low, high))) * effect.scale
    negative = effect.lower < 0 and (effect.upper <= 0 or rng.random() < 0.5)
    amplitude = max(-size, effect.lower) if negative else min(size, effect.upper)
    exact, other = rng.random() < EXACT, course(rng, span)
    return Cause(effect if exact else warped(effect, system, other), amplitude)


def live(made_by: Generator, drawn: Drawn) -> tuple[Made, float]:
    """The recording before it is measured, and the gap that its causes make [noise of the most touched output].

    Raises
    ------
    SimulationError
        If it cannot be simulated.
    """
    case, noise = drawn.case, made_by.truth.measuring.noise
    nothing = made_by.make_case(_with(case))

    def of_size(acts: Process, gap: float) -> list[Cause]:
        """The process so that it makes a gap, or none where it moves nothing."""
        acts = acts.of_spread(nothing.driven)
        unit = made_by.make_case(_with(case, Cause(acts, acts.scale)))
        size = gap_of(made_by.system, noise, unit.clean - nothing.clean)
        return [Cause(acts, acts.scale * min(gap / size, MOST))] if size > gap / (10 * MOST) else []

    background = of_size(*drawn.background)
    causes = [*case.causes, *(of_size(*drawn.outside) if drawn.outside is not None else [])]
    if not causes:
        return made_by.make_case(_with(case, *background)), 0.0
    without = made_by.make_case(_with(case, *background))
    made = made_by.make_case(_with(case, *background, *causes))
    for cause in case.causes:
        if isinstance(cause.acts, Warped) and cause.acts.by_parameters:
            rest = [one for one in causes if one is not cause]
            other = made_by.make_case(_with(case, *background, *rest)) if rest else without
            moved = (cause.acts.course.at(made.time) - 1.0) * (made.clean - other.clean)
            made = replace(made, clean=made.clean + moved)
    return made, gap_of(made_by.system, noise, made.clean - without.clean)


def gap_of(system: System, noise: str, moved: np.ndarray) -> float:
    """Root mean square of what moved (outputs, steps) at the most touched output [its noise]."""
    return float(np.max(np.sqrt(np.mean(moved**2, axis=1)) / system.noise_sd(noise)))


def work(made_by: Generator, seed: int, index: int) -> dict[str, Any]:
    """Make a recording and diagnose it: its row as it is written.

    Raises
    ------
    SimulationError
        If no draw could be simulated.
    """
    for attempt in range(ATTEMPTS):
        drawn = draw(made_by, seed, index, attempt)
        try:
            made, gap = live(made_by, drawn)
            break
        except SimulationError as error:
            last = error
    else:
        raise SimulationError(f"recording {index} of seed {seed}: none of {ATTEMPTS} draws could be simulated: {last}")
    if gap < BACKGROUND[0]:
        drawn = replace(drawn, stratum="none", true=(), withheld="")
    system, truth = made_by.system, made_by.truth
    outputs, _ = measured(made, system, truth)
    with TemporaryDirectory(prefix="farm") as folder:
        path = Path(folder) / f"{index}.nc"
        write(path, published(made, outputs, system, truth))
        return asdict(diagnosed(made_by, path, drawn, gap, made.parameters, seed + index))


def diagnosed(
    made_by: Generator, path: Path, drawn: Drawn, gap: float, parameters: Mapping[str, float], seed: int
) -> Row:
    """What the diagnosis makes of a recording without what is withheld; ``parameters`` are the true ones."""
    from diagnosis.gap.diagnosed import diagnose

    began, system = time.process_time(), made_by.system
    done = diagnose(
        system,
        path,
        replay=drawn.case.replay,
        occupancy="unknown" if drawn.case.unknown_occupancy else "measured",
        noise=made_by.truth.measuring.noise,
        effects=[one for one in library(system) if one.name != drawn.withheld],
        how_far=False,
        seed=seed,
    )
    fit = done.search.settled[-1] if done.search.chosen else done.search.base
    error = (fit.lin.z - fit.lin.problem.unknowns(parameters)) / fit.grams.spread
    of_each = np.stack([error, fit.sd / fit.grams.spread], axis=1)[: len(system.parameters)]
    return Row(
        index=drawn.case.index,
        stratum=drawn.stratum,
        true=drawn.true,
        withheld=drawn.withheld,
        gap=gap,
        evidence=done.evidence,
        errors=tuple((error, sd) for error, sd in of_each.tolist()),
        cpu_seconds=time.process_time() - began,
        simulations=done.report.simulations,
    )


def read_row(raw: dict[str, Any]) -> Row:
    """A row as it was written.

    Raises
    ------
    RecordingError
        If it is of another version, whose diagnosis told other things.
    """
    try:
        evidence = Evidence(**{**raw["evidence"], "chosen": tuple(raw["evidence"]["chosen"])})
        errors = tuple((error, sd) for error, sd in raw["errors"])
        return Row(**{**raw, "true": tuple(raw["true"]), "evidence": evidence, "errors": errors})
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(
            f"row {raw.get('index', '?')} is of another version of `diagnosis farm` ({error}); expected rows"
            " of this one: give another --out"
        ) from None


def _one_of(shares: dict[str, float], place: float) -> str:
    names = [*shares]
    return names[min(int(np.searchsorted(np.cumsum([*shares.values()]), place, side="right")), len(names) - 1)]


def _acts(effect: Effect, replay: bool) -> bool:
    spec = getattr(effect, "spec", None)
    return spec is None or ("replay" if replay else "control") in spec.modes


def _with(case: Case, *causes: Cause) -> Case:
    return Case(case.seed, case.index, case.stratum, causes, case.unknown_occupancy, case.replay, case.attempt)
