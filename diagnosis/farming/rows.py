"""One recording of the farm: its cause drawn, lived and measured, and what the diagnosis makes of it."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from datagen.driving.sampling import record_start, stream
from diagnosis.blind.draw import Case, Cause
from diagnosis.blind.generator import Generator, Made
from diagnosis.blind.measuring import measured, published, write
from diagnosis.blind.truth import Measuring, Strata, Truth
from diagnosis.effects import Effect, clash, library
from diagnosis.farming.laws import EXACT, Process, Warped, course, outside
from diagnosis.gap.evidence import Evidence
from diagnosis.recording import HOUR
from shared.errors import SimulationError
from shared.system import System

STRATA = {"none": 0.4, "listed": 0.34, "two": 0.08, "withheld": 0.08, "outside": 0.1}
"""How often a recording has no cause, a candidate's, two candidates', one of a candidate that the diagnosis is not
given, or another."""
AMPLITUDES = (0.25, 4.0)
"""Of a candidate's cause, log-uniform [its scales]."""
GAPS = (0.5, 6.0)
"""Root mean square that a cause outside the library makes at the most touched output, log-uniform [its noise]."""
BACKGROUND = (0.05, 0.5)
"""The same of a process that every room has beside its cause: no building is as its model, and that is no gap."""
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

    ``stratum`` is one of :data:`STRATA`; ``true``: candidates that are right answers, ``withheld`` the one that the
    diagnosis was not given; ``amplitudes`` of the causes; ``gap`` the root mean square of what they do at the most
    touched output [its noise].
    """

    index: int
    stratum: str
    true: tuple[str, ...]
    withheld: str
    amplitudes: tuple[float, ...]
    gap: float
    evidence: Evidence
    cpu_seconds: float
    simulations: int


@dataclass(frozen=True)
class Rows:
    """Rows in the order of their numbers, and what they are of (``about``): system, seed, length, and the like."""

    about: dict[str, Any]
    rows: tuple[Row, ...]


@dataclass(frozen=True)
class Drawn:
    """A recording before it is lived: its case, and what :class:`Row` says of it.

    ``processes`` act beside the case's causes, each so that it alone makes a gap of that size.
    """

    case: Case
    stratum: str
    processes: tuple[tuple[Process, float], ...]
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
    rng = stream(seed, index, f"farm.{attempt}")
    stratum = _one_of(STRATA, stream(seed, index, "farm.stratum").random())
    replay = bool(rng.random() < REPLAY) and any(one.source == "measured" for one in system.inputs)
    unknown = bool(rng.random() < UNKNOWN)
    case = Case(seed, index, stratum, (), unknown, replay, attempt)
    start = record_start(made_by.system, case.root, index)
    begin, stop = start - system.experiment.warm_up_hours * HOUR, start + made_by.hours * HOUR
    effects = [one for one in made_by.effects if _acts(one, replay)]
    background = (outside(system, rng, begin, stop, noise), float(np.exp(rng.uniform(*np.log(BACKGROUND)))))
    if stratum == "none" or not (effects or stratum == "outside"):
        return Drawn(case, "none", (background,))
    if stratum == "outside":
        acts = outside(system, rng, begin, stop, noise)
        true = tuple(one.name for one in made_by.effects if one.changes & acts.changes)
        size = float(np.exp(rng.uniform(*np.log(GAPS))))
        return Drawn(case, stratum, (background, (acts, size)), true)
    effect = effects[int(rng.integers(len(effects)))]
    causes = [_cause(effect, rng, begin, stop)]
    partners = [one for one in effects if one is not effect and not clash([effect, one])]
    if stratum == "two" and partners:
        causes.append(_cause(partners[int(rng.integers(len(partners)))], rng, begin, stop))
    case = _with(case, *causes)
    if stratum == "withheld":
        return Drawn(case, stratum, (background,), withheld=effect.name)
    return Drawn(case, stratum, (background,), tuple(one.label for one in causes))


def _cause(effect: Effect, rng: np.random.Generator, begin: float, stop: float) -> Cause:
    """A candidate's cause of random size, by a law of its own or by the candidate's."""
    low, high = np.log(AMPLITUDES)
    size = float(np.exp(rng.uniform(low, high))) * effect.scale
    negative = effect.lower < 0 and (effect.upper <= 0 or rng.random() < 0.5)
    amplitude = max(-size, effect.lower) if negative else min(size, effect.upper)
    warped = rng.random() >= EXACT
    return Cause(Warped(effect, course(rng, begin, stop)) if warped else effect, amplitude)


def live(made_by: Generator, drawn: Drawn) -> Made:
    """The recording before it is measured, with processes as large as their gaps make them.

    Raises
    ------
    SimulationError
        If it cannot be simulated.
    """
    case, causes = drawn.case, [*drawn.case.causes]
    nothing = made_by.make_case(_with(case))
    for acts, gap in drawn.processes:
        unit = made_by.make_case(_with(case, Cause(acts, acts.scale)))
        size = gap_of(made_by.system, made_by.truth.measuring.noise, unit.clean - nothing.clean)
        if size > 0:  # one that moves no output, such as the sun on a room without windows, is none
            causes.append(Cause(acts, acts.scale * gap / size))
    return made_by.make_case(_with(case, *causes))


def gap_of(system: System, noise: str, moved: np.ndarray) -> float:
    """Root mean square of what moved (outputs, steps) at the most touched output [its noise]."""
    sds = [np.hypot(one.noise[noise].sd if noise in one.noise else 0.0, one.accuracy) for one in system.outputs]
    return float(np.max(np.sqrt(np.mean(moved**2, axis=1)) / np.asarray(sds)))


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
            made = live(made_by, drawn)
            break
        except SimulationError as error:
            last = error
    else:
        raise SimulationError(f"recording {index} of seed {seed}: none of {ATTEMPTS} draws could be simulated: {last}")
    system, truth = made_by.system, made_by.truth
    outputs, _ = measured(made, system, truth)
    with TemporaryDirectory(prefix="farm") as folder:
        path = Path(folder) / f"{index}.nc"
        write(path, published(made, outputs, system, truth))
        return asdict(diagnosed(system, truth.measuring.noise, path, drawn, made, seed + index))


def diagnosed(system: System, noise: str, path: Path, drawn: Drawn, made: Made, seed: int) -> Row:
    """What the diagnosis makes of a recording without what is withheld."""
    from diagnosis.gap.diagnosed import diagnose

    began = time.process_time()
    done = diagnose(
        system,
        path,
        replay=drawn.case.replay,
        occupancy="unknown" if drawn.case.unknown_occupancy else "measured",
        noise=noise,
        effects=[one for one in library(system) if one.name != drawn.withheld],
        how_far=False,
        seed=seed,
    )
    return Row(
        index=drawn.case.index,
        stratum=drawn.stratum,
        true=drawn.true,
        withheld=drawn.withheld,
        amplitudes=tuple(one.amplitude for one in made.case.causes),
        gap=gap_of(system, noise, made.clean - made.base),
        evidence=done.evidence,
        cpu_seconds=time.process_time() - began,
        simulations=done.report.simulations,
    )


def read_row(raw: dict[str, Any]) -> Row:
    """A row as it was written."""
    evidence = Evidence(**{**raw["evidence"], "chosen": tuple(raw["evidence"]["chosen"])})
    return Row(**{**raw, "true": tuple(raw["true"]), "amplitudes": tuple(raw["amplitudes"]), "evidence": evidence})


def _one_of(shares: dict[str, float], place: float) -> str:
    names = [*shares]
    return names[min(int(np.searchsorted(np.cumsum([*shares.values()]), place, side="right")), len(names) - 1)]


def _acts(effect: Effect, replay: bool) -> bool:
    spec = getattr(effect, "spec", None)
    return spec is None or ("replay" if replay else "control") in spec.modes


def _with(case: Case, *causes: Cause) -> Case:
    return Case(case.seed, case.index, case.stratum, causes, case.unknown_occupancy, case.replay, case.attempt)
