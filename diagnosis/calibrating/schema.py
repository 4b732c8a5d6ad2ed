"""``calibration.json``: what a calibration found.

Which days a calibration has seen, so that no forecast of them passes for one: days are known by their readings.

Neither a path nor where a recording begins tells: copies have other paths, and cuts other beginnings and lengths. Nor
need the same log be imported the same way: with other outputs, with a reading more or less of one, or with other steps.
So a day is known by any one output, and at steps that divide an hour by its readings at full hours: those of an
instant are the same at all such steps (those of a mean are not).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from diagnosis.fitting.fit import Fit, doubted
from diagnosis.physics import Finding
from diagnosis.recording import HOUR, Recording
from diagnosis.scores import Score, score
from diagnosis.usual import HALF_WIDTH
from shared.errors import RecordingError
from shared.logs import logger
from shared.reading import newer, read_json, shown, validated

_log = logger(__name__)

SCHEMA_VERSION = 8


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Parameter(_Table):
    """One parameter.

    ``low`` and ``high`` are the ends of the 90 % credible interval [unit]; ``told`` is the share of
    the prior variance that the recording removed, in the scale in which the prior is standard normal.
    """

    name: str
    description: str
    unit: str
    prior_min: float
    prior_max: float
    value: float
    low: float
    high: float
    told: float
    identified: str
    at_bound: bool
    zero_shot: float | None = None


class Constant(_Table):
    """An uncertain constant: by what its FMU parameters are multiplied, with the 90 % credible interval."""

    name: str
    description: str
    factor: float
    low: float
    high: float


class Channel(Score):
    """One output.

    Scores of the fit, the standard deviation of a reading's noise that was ``declared`` (of an undeclared one, that as
    which it was taken) and the noise that was found [unit; h]. ``chi2`` is the mean square of the
    standardised residual with the nuisance integrated out: near 1 where model and noise explain the recording.
    ``explained``: share of the variance that the model explains with the most likely nuisance, both without that of
    the sensor's declared noise; None for an output that hardly moved beyond it, or was replayed.
    """

    used: bool
    declared: float
    noise: float
    slow_noise: float
    slow_hours: float
    chi2: float | None
    explained: float | None = None


class Pair(_Table):
    """Two parameters that the recording cannot well tell apart."""

    first: str
    second: str
    correlation: float


class Day(_Table):
    """A day that was fitted: begin of its first step by the recording's clock, its steps.

    ``sha256`` is that of the readings of each output that moved, of none where they do not tell the day from others:
    see :mod:`diagnosis.calibrating.schema`.
    """

    begin: str
    steps: int
    sha256: dict[str, str]


class Calibration(_Table):
    """``calibration.json``.

    ``covariance`` (unknowns, unknowns) is that of the posterior in which the recording counts for 1 / ``widened``^2 of
    what it is worth to the model: see :mod:`diagnosis.fitting.fit`. ``undeclared``: of outputs whose sensor has no
    declared noise, as how exact they were taken. ``physics``: what in the recording cannot be, or contradicts the
    description. What each schema added is in CHANGELOG.md.
    """

    schema_version: int = SCHEMA_VERSION
    system: str
    system_hash: str
    fmu_sha256: str
    recording: str
    steps: int
    step: float
    start: float
    days: Annotated[list[Day], Field(min_length=1)]
    replay: bool
    occupancy: str
    assumed: dict[str, str]
    replayed: list[str]
    started_from: str
    parameters: list[Parameter]
    constants: list[Constant] = []
    correlated: list[Pair]
    correlation: list[list[float]]
    outputs: dict[str, Channel]
    undeclared: dict[str, str] = {}
    z: list[float]
    covariance: list[list[float]]
    widened: float
    physics: list[Finding] = []
    wider: str = Field("", description="the description with wider ranges, if the system names one")
    log_likelihood: float
    log_evidence: float
    converged: bool
    stopped: bool = Field(False, description="whether the time was up before the fit came to rest")
    simulations: int
    seconds: float

    def parameter(self, name: str) -> Parameter:
        """A parameter by its name."""
        return next(one for one in self.parameters if one.name == name)


def read_calibration(path: Path | str) -> Calibration:
    """Read ``calibration.json``, or the one in a folder.

    Raises
    ------
    RecordingError
        If it is missing, not such a file, or of an earlier version.
    """
    path = Path(path)
    path = path / "calibration.json" if path.is_dir() else path
    expected = "a file of `diagnosis calibrate`"
    raw = read_json(path, RecordingError, expected)
    version = raw.get("schema_version") if isinstance(raw, dict) else None
    if isinstance(version, int) and version < SCHEMA_VERSION:
        lacks = "does not say, output by output, all days that the calibration has seen"
        lacks = lacks if version < 7 else "has shares of a temperature's range as CVRMSE and NMBE"
        raise RecordingError(
            f"{path}: schema_version is {shown(version)}, which {lacks}; expected {SCHEMA_VERSION}, {expected} of this"
            " version: calibrate again"
        )
    if said := newer(SCHEMA_VERSION if version is None else version, SCHEMA_VERSION):
        raise RecordingError(f"{path}: {said}")
    return validated(Calibration, raw, f"{path}", RecordingError, expected)


NEAR = 1e-3
"""Steps are the same that differ by less than this share."""
TELLING = 8
"""So many different readings of a day tell it from others, or as many as a shorter one has: a flow by timetable is the
same in many rooms."""


def days_of(recording: Recording, names: Sequence[str]) -> list[Day]:
    """The days of a recording by its own clock, from the first to the last reading of any output.

    Steps beyond, of weather to come, say, tell a fit nothing and have not been seen.
    Outputs, whose names are ``names``, have no hash where they hardly move: then they are alike in recordings that have
    nothing to do with each other. A day without any hash was fitted all the same, and is known by its neighbours.
    """
    begins = _begins(recording)
    read = np.flatnonzero(np.isfinite(recording.outputs).any(axis=0))
    first, after = (int(read[0]), int(read[-1]) + 1) if read.size else (0, len(begins))
    date = begins[first:after].astype("datetime64[D]")
    edges = [first, *(first + np.flatnonzero(date[1:] != date[:-1]) + 1).tolist(), after]
    return [
        Day(begin=str(begins[a]), steps=b - a, sha256=_hashes(recording, names, slice(a, b)))
        for a, b in pairwise(edges)
    ]


def check_unseen(report: Calibration, record: Recording, names: Sequence[str], split: int, end: int) -> None:
    """Refuse a calibration that has seen any of the steps ``split`` to ``end``: scores would be those of a fit.

    It has if it was made from this file, or from any day of it, and reaches there: all that lies between the first and
    the last day of a calibration was fitted. Where no day of it can be told from those of other recordings, and its
    dates are among those ahead, a warning says that nothing could be checked. ``names`` are those of the outputs.

    Raises
    ------
    RecordingError
        Naming the first step that was seen.
    """
    begin, after = _span(report)
    ahead = _begins(record)[split:end]
    seen = ahead[(ahead >= begin) & (ahead < after)]
    if not len(seen):
        return
    first = str(seen[0].astype("datetime64[m]")).replace("T", " ")
    known = [_is_in(day, report.step, record, names) for day in report.days]
    if _same_file(report, record) or any(known):
        raise RecordingError(
            f"{record.path}: {first} and what follows is to be forecast, but is among what"
            f" the given calibration was made from ({report.recording}); expected one that has seen none of the"
            f" {(end - split) * record.step / HOUR:g} h ahead, or none, to calibrate on the context"
        )
    if all(one is None for one in known):
        _log.warning(
            "%s: whether the given calibration (of %s) has seen %s and what follows could not be checked: no day that"
            " both have can be told by its readings, and by their dates it may have",
            record.path,
            report.recording,
            first,
        )


def _same_file(report: Calibration, record: Recording) -> bool:
    return Path(report.recording).resolve() == record.path.resolve()


def _span(report: Calibration) -> tuple[np.datetime64, np.datetime64]:
    """From when until when a calibration has seen readings, by its recording's clock."""
    first, last = report.days[0], report.days[-1]
    after = np.datetime64(last.begin, "s") + np.timedelta64(round(last.steps * report.step), "s")
    return np.datetime64(first.begin, "s"), after


def _begins(recording: Recording) -> np.ndarray:
    """When steps begin, by the recording's clock, to the second, shape (steps,)."""
    seconds = np.round(recording.time - recording.step).astype("timedelta64[s]")
    return np.asarray(recording.zero.astype("datetime64[s]") + seconds)


def _is_in(day: Day, step: float, record: Recording, names: Sequence[str]) -> bool | None:
    """Whether a recording has the readings that a day had in one of steps of ``step`` [s], of any output.

    None where nothing tells: it has no such day, or no output whose readings could be compared.
    """
    same = abs(step - record.step) <= NEAR * step
    if not day.sha256 or (not same and not (_divides_an_hour(step) and _divides_an_hour(record.step))):
        return None
    begin, span = np.datetime64(day.begin, "s"), np.timedelta64(round(day.steps * step), "s")
    begins = _begins(record)
    inside = np.flatnonzero((begins >= begin) & (begins < begin + span))
    if not len(inside) or len(inside) != round(day.steps * step / record.step) or begins[inside[0]] != begin:
        return None
    found = _hashes(record, names, slice(int(inside[0]), int(inside[-1]) + 1))
    compared = [found[name] == one for name, one in day.sha256.items() if name in found]
    return any(compared) if compared else None


def _divides_an_hour(step: float) -> bool:
    return abs(HOUR / step - round(HOUR / step)) < NEAR


def _hashes(record: Recording, names: Sequence[str], part: slice) -> dict[str, str]:
    """The sha256 of the readings of each output that moves, as single precision holds them: files are often so."""
    ends = np.round(record.time[part])
    full = ends % HOUR == 0
    told = full if _divides_an_hour(record.step) and full.any() else np.ones(len(ends), dtype=bool)
    found = {}
    for name, row in zip(names, record.outputs[:, part][:, told], strict=True):
        seen = row[np.isfinite(row)]
        if len(np.unique(seen)) < max(2, min(TELLING, len(row))):
            continue
        readings = np.where(np.isfinite(row), row, np.nan).astype(np.float32) + np.float32(0)  # no negative zeros
        found[name] = hashlib.sha256(np.ascontiguousarray(readings, dtype="<f4").tobytes()).hexdigest()
    return found


TOLD = (0.5, 0.9)
"""Shares of the prior variance that the recording removed: below the first a parameter is hardly told, above the
second it is told well."""
CORRELATED = 0.8
STILL = 2.0
"""An output that moves by less than this many standard deviations of its sensor's noise does not move."""


def summarise(found: Fit, zero_shot: dict[str, float], doubt: float) -> Calibration:
    """The report of a fit, its recording doubted (:func:`diagnosis.fitting.fit.doubted`)."""
    problem = found.problem
    system = problem.system
    count = len(system.parameters)
    covariance = doubted(found.covariance, doubt)
    sd = np.sqrt(np.diag(covariance))
    low, value, high = (problem.values(found.z + k * HALF_WIDTH * sd) for k in (-1, 0, 1))
    parameters = [
        Parameter(
            name=one.name,
            description=one.description,
            unit=one.unit,
            prior_min=one.min,
            prior_max=one.max,
            value=float(value[k]),
            low=float(low[k]),
            high=float(high[k]),
            told=float(1 - sd[k] ** 2),
            identified=_identified(1 - sd[k] ** 2),
            at_bound=one.name in found.at_bound,
            zero_shot=zero_shot.get(one.name),
        )
        for k, one in enumerate(system.parameters)
    ]
    first = count + len(problem.effects)
    constants = [
        Constant(
            name=one.name,
            description=one.description,
            factor=float(value[k]),
            low=float(low[k]),
            high=float(high[k]),
        )
        for k, one in enumerate(system.uncertain if problem.constants else (), first)
    ]
    correlation = covariance / np.outer(sd, sd)
    pairs = [
        Pair(first=problem.names[i], second=problem.names[j], correlation=float(correlation[i, j]))
        for i, j in _pairs(count)
        if abs(correlation[i, j]) > CORRELATED
    ]
    return Calibration(
        system=system.name,
        system_hash=system.hash(),
        wider=system.wider,
        fmu_sha256=problem.simulator.fmu.sha256,
        recording=str(problem.recording.path),
        steps=len(problem.time),
        step=problem.recording.step,
        start=problem.recording.start,
        days=days_of(problem.recording, system.output_names),
        replay=problem.replay,
        occupancy=problem.occupancy,
        assumed=problem.drive.assumed,
        replayed=list(problem.drive.replayed),
        started_from=found.started_from,
        parameters=parameters,
        constants=constants,
        correlated=sorted(pairs, key=lambda pair: -abs(pair.correlation)),
        correlation=correlation.tolist(),
        outputs=_channels(found),
        undeclared=problem.undeclared,
        z=found.z.tolist(),
        covariance=covariance.tolist(),
        widened=doubt,
        log_likelihood=found.log_likelihood,
        log_evidence=found.log_evidence,
        converged=found.converged,
        stopped=problem.runner.time_up,
        simulations=found.simulations,
        seconds=found.seconds,
    )


def _identified(told: float) -> str:
    return "well" if told >= TOLD[1] else "partly" if told >= TOLD[0] else "hardly"


def _pairs(count: int) -> Iterator[tuple[int, int]]:
    return ((i, j) for i in range(count) for j in range(i))


def _channels(found: Fit) -> dict[str, Channel]:
    problem, noise = found.problem, found.problem.noise
    parts = np.split(found.residual, np.cumsum(problem.observed.sum(axis=1))[:-1])
    made = {}
    for k, output in enumerate(problem.system.outputs):
        seen = np.isfinite(problem.measured[k])
        if not seen.any():
            continue
        used = bool(problem.observed[k].any())
        scores = score(problem.measured[k], found.around.outputs[k], output.unit)
        made[output.name] = Channel(
            **scores.model_dump(),
            used=used,
            declared=float(problem.floor[k]),
            noise=float(noise.white[k]),
            slow_noise=float(noise.slow[k]),
            slow_hours=float(noise.time[k] / HOUR) if noise.slow[k] > 0 else 0.0,
            chi2=float(np.mean(parts[k] ** 2)) if used else None,
            explained=_explained(problem.measured[k], found.around.outputs[k], problem.floor[k]) if used else None,
        )
    return made


def _explained(measured: np.ndarray, fitted: np.ndarray, noise: float) -> float | None:
    """Share of a series' variance (steps,) that another explains, beyond noise of a standard deviation [unit].

    None where the series and what is left of it are both within :data:`STILL` of that noise: there is nothing to tell.
    """
    seen = np.isfinite(measured)
    moved = max(float(np.var(measured[seen])) - noise**2, 0.0)
    left = max(float(np.mean((measured[seen] - fitted[seen]) ** 2)) - noise**2, 0.0)
    still = (STILL**2 - 1) * noise**2
    return None if max(moved, left) <= still else 1 - left / max(moved, still, 1e-300)
