"""What drives the model over a recording: every input as a signal, measured, counted or from the description.

What happened within a long step of which only the mean is known: when people came, when the heater was on.

Persons who were counted come and go within a step as the description's random occupancy says they do where the means of
that step and of the two on either side are such: mean and covariance over the nearest of many draws
(k-nearest-neighbour regression; Stone 1977, Annals of Statistics 5:595). Were they held at the mean, a room would seem
to follow people faster than it does, because there are more of them at the end of an hour in which they come. Of a
replayed actuator nothing is known but how much the steps beside it differ.

What a meter would have shown without its noise, as far as its readings tell: this drives the model in replay.

Driven by readings as they are, a model answers to their noise as well, which the room never felt. A fit then makes that
answer smaller, as a slope is too flat where what stands on the axis is noisy (attenuation; Carroll, Ruppert, Stefanski
and Crainiceanu 2006, Measurement Error in Nonlinear Models, chapter 3): the flow of a ventilation that hardly varies
seems to be much less than was read. So readings are replaced by their expectation (regression calibration, chapter 4
there), and what stays unknown of them is a nuisance (:mod:`diagnosis.fitting.lines`).

The noise is as large as the description says, a part of it slow. The actuator's own course is taken for an
Ornstein-Uhlenbeck process around a level, over whose size and memory the expectation is taken as well: where readings
scatter no more than their noise does, they cannot tell a small variation from none. All precisions are banded.

Before its start the recording's first day is repeated, so that the simulation arrives at it warmed up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import ClassVar

import numpy as np
from scipy.constants import Stefan_Boltzmann
from scipy.linalg import block_diag, cho_solve_banded, cholesky_banded, eigh
from scipy.spatial import cKDTree

from datagen.driving.inputs import schedule_signal
from datagen.driving.occupancy import headcounts, occupancy_means, occupancy_prior, prior_draw
from datagen.driving.tables import SNAP, Piecewise
from diagnosis.fitting.nuisance import Level, Nuisance, joined, no_nuisance, pulses_on
from diagnosis.recording import DAY, HOUR, Recording, extended, sentence_on_missing, whole_days
from shared.errors import RecordingError, SystemDescriptionError
from shared.signals import Occupancy
from shared.system import System
from shared.variables import Input, MeasuredInput, WeatherInput

LONG = 2700.0
"""Steps at least so long have something within them that matters [s]."""
BESIDE = 2
"""Steps on either side that tell how a step went."""
ROOMS = 1000
"""Drawn for a week each."""
NEAREST, WIDER = 40, 1000
RARE = 0.1
"""Share of the covariance that is that of the wider neighbours: what happens rarely is not among the nearest few."""
LEFT_OUT = 1e-3
"""Share of the signal's standard deviation below which what happens within a step is left out."""
HAAR = np.array([[0.5, 0.5, 0.0, 0.0], [0.5, -0.5, 0.0, 0.0], [0.0, 0.0, 0.5, -0.5]])
"""Heights of the pulses of :func:`_pulses` that make given deviations of quarters from their mean."""


def counted(spec: Occupancy, place: int, recording: Recording, signal: Piecewise) -> tuple[Nuisance, Piecewise]:
    """How persons who were counted as means over long steps came and went within them.

    Parameters
    ----------
    place
        Of the input among the system's.
    signal
        The means, and what stands in for them before the recording.

    Returns
    -------
    tuple
        What is not known of the quarters of steps, and the signal with their expected values; before the recording, and
        with short steps, as it was.
    """
    if recording.step < LONG:
        return no_nuisance(), signal
    step = recording.step
    middles = recording.time - 0.5 * step
    means = signal.at(middles)
    beside = np.stack([signal.at(middles + k * step) for k in range(-BESIDE, BESIDE + 1)], axis=1)
    mean, covariance = _expected(spec, step, beside)
    quarters = (means[:, None] + mean).ravel()
    begins = (recording.time[:, None] - step * np.array([1.0, 0.75, 0.5, 0.25])).ravel()
    past = signal.times < begins[0] - SNAP
    shown = Piecewise(np.append(signal.times[past], begins), np.append(signal.values[past], quarters), "previous")
    return _pulses(place, recording, HAAR @ covariance @ HAAR.T, float(means.std())), shown


def replayed(place: int, recording: Recording, signal: Piecewise) -> Nuisance:
    """Means over long steps: the halves of a step may differ as much as its neighbours do, and so may its quarters.

    What changes once, at any time of a step with equal probability, changes within each half of it with half the
    probability, but then as much: the spread of a half's halves is sqrt(1/2) of that of the step's. An actuator that
    never ran backwards did not within a step either: a heater that gave next to nothing in an hour did not give much in
    one half of it, and what a model made of less than nothing would be no answer to a change within the step.
    """
    if recording.step < LONG:
        return no_nuisance()
    values = signal.at(recording.time - 0.5 * recording.step)
    change = np.abs(np.diff(values))
    spread = 0.5 * np.maximum(np.append(0.0, change), np.append(change, 0.0))
    spread = np.minimum(spread, values - min(values.min(), 0.0))
    covariance = spread[:, None, None] ** 2 * np.diag([1.0, 0.5, 0.5])
    return _pulses(place, recording, covariance, float(values.std()))


def _pulses(place: int, recording: Recording, covariance: np.ndarray, size: float) -> Nuisance:
    """Differences between halves of steps, and between the halves of each half, with covariances (steps, 3, 3)."""
    spread = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    some = np.flatnonzero(spread > LEFT_OUT * max(size, 1e-12))
    if not len(some):
        return no_nuisance()
    values, vectors = np.linalg.eigh(covariance[some])
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    half = 0.5 * recording.step
    begin = (recording.time[some, None] - np.array([2 * half, 2 * half, half])).ravel()
    end = begin + np.tile([2 * half, half, half], len(some))
    pulses = pulses_on(place, begin, end, block_diag(*roots), turns=True)
    return pulses.only(pulses.sd > 0.1 * LEFT_OUT * size)


def _expected(spec: Occupancy, step: float, means: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deviations of a step's quarters from its mean, given those of the steps around it (steps, around) [persons].

    Returns
    -------
    tuple
        Mean (steps, 4) [persons] and covariance (steps, 4, 4) [persons²]; nothing where the means do not differ. Steps
        that are like no draw are less certain: a quarter of the squared distance of the nearest is added.
    """
    tree, shapes = _draws(spec, step)
    mean, covariance = np.zeros((len(means), 4)), np.zeros((len(means), 4, 4))
    most = np.abs(means).max(axis=1)
    some = np.flatnonzero(np.ptp(means, axis=1) > LEFT_OUT * most)
    if tree is None or not len(some):
        return mean, covariance
    distance, places = tree.query(means[some] / most[some, None], k=np.arange(1, min(WIDER, len(shapes)) + 1))
    near = shapes[places[:, :NEAREST]]
    middle = near.mean(axis=1, keepdims=True)
    mean[some] = most[some, None] * middle[:, 0]
    apart = np.mean(distance[:, :NEAREST] ** 2, axis=1)
    unlike = 0.25 * apart[:, None, None] * (np.eye(4) - 0.25)
    spread = (1 - RARE) * _second_moment(near - middle) + RARE * _second_moment(shapes[places] - middle)
    covariance[some] = most[some, None, None] ** 2 * (spread + unlike)
    return mean, covariance


def _second_moment(values: np.ndarray) -> np.ndarray:
    """Mean product of values (n, draws, k) with themselves, shape (n, k, k)."""
    return np.asarray(np.matmul(values.transpose(0, 2, 1), values) / values.shape[1])


@lru_cache(maxsize=4)
def _draws(spec: Occupancy, step: float) -> tuple[cKDTree | None, np.ndarray]:
    """Steps of random rooms in which, or beside which, persons come or go, in shares of the most that are there.

    Returns
    -------
    tuple
        Their means and those of the steps around them, to be searched, and the deviations of their quarters (draws, 4).
    """
    steps = max(round(7 * DAY / step), 1)
    quarters = occupancy_prior(spec, 0.25 * step * np.arange(4 * (steps + 2 * BESIDE) + 1), ROOMS, seed=0)
    quarters = quarters.reshape(ROOMS, -1, 4)
    means = quarters.mean(axis=2)
    around = np.lib.stride_tricks.sliding_window_view(means, 2 * BESIDE + 1, axis=1).reshape(-1, 2 * BESIDE + 1)
    shapes = (quarters - means[..., None])[:, BESIDE:-BESIDE].reshape(-1, 4)
    some = np.ptp(around, axis=1) > 0
    if not some.any():
        return None, shapes[:0]
    most = around[some].max(axis=1, keepdims=True)
    return cKDTree(around[some] / most), shapes[some] / most


SLOW = 0.3
"""Share of a meter's variance that is slow, and its memory: not known, but a meter without any would be rare."""
MEMORY = 6 * HOUR
SMALLEST, SIZES = 0.3, 12
"""Of the process, in standard deviations of the noise, and how many sizes up to three times those of the readings.
Smaller ones still would make it too sure that an air flow which hardly varies does not vary."""
MEMORIES = (2 * HOUR, 6 * HOUR, DAY, 4 * DAY)
NEGLIGIBLE = 0.003
"""Probability below which a size and memory are left out."""


@dataclass(frozen=True)
class _Course:
    """One size and memory: its probability, the expectation (steps,), and the factor of the banded precision.

    ``level`` (steps,) is what one standard deviation of the level does to the expectation.
    """

    share: float
    values: np.ndarray
    level: np.ndarray
    factor: np.ndarray


METERED = 3 * HOUR
"""What a meter gets wrong is a mean over this [s]."""


@dataclass(frozen=True)
class Cleared:
    """Readings without their noise: ``values`` (steps,) are what is expected [unit of the reading]."""

    values: np.ndarray
    courses: tuple[_Course, ...] = ()
    pulse: ClassVar[float] = METERED

    def covariance(self, weights: np.ndarray) -> np.ndarray:
        """Covariance of what stays unknown of weighted means (means, steps), shape (means, means)."""
        wide = np.zeros((2 * weights.shape[1], len(weights)))
        wide[0::2] = weights.T
        total = np.zeros((len(weights), len(weights)))
        for one in self.courses:
            away, level = weights @ (one.values - self.values), weights @ one.level
            within = wide.T @ cho_solve_banded((one.factor, True), wide)
            total += one.share * (within + np.outer(level, level) + np.outer(away, away))
        return total


def cleared(readings: np.ndarray, sd: float, step: float) -> Cleared:
    """Expected values of what was read.

    Parameters
    ----------
    readings
        Shape (steps,), NaN where lost; at least one is not.
    sd
        Standard deviation of the meter's noise [unit of the reading].
    step
        Between readings [s].
    """
    seen = np.isfinite(readings)
    mean, spread = float(readings[seen].mean()), float(readings[seen].std())
    if sd <= 0 or spread <= 0:
        return Cleared(_held(readings, seen))
    weight = seen / ((1 - SLOW) * sd**2)
    slow, _ = _process(len(readings), np.sqrt(SLOW) * sd, MEMORY, step)
    left = np.where(seen, readings - mean, 0.0)
    scores = np.repeat(np.stack([weight * left, weight], axis=1), 2, axis=0)
    found: list[tuple[float, _Course]] = []
    for size in np.geomspace(SMALLEST * sd, 3 * max(spread, sd), SIZES):
        for memory in MEMORIES:
            own, logdet = _process(len(readings), size, memory, step)
            factor = cholesky_banded(_joint(own, slow, weight), lower=True)
            likely = cho_solve_banded((factor, True), scores)
            # of readings and a level of one: products with the inverse of the readings' covariance
            products = scores[0::2].T @ np.stack([left, seen], axis=1) - scores.T @ likely
            level, information = products[0, 1] / products[1, 1], products[1, 1]
            evidence = 0.5 * (logdet - products[0, 0] + level * products[0, 1] - float(np.log(information)))
            moved = 1.0 - likely[0::2, 1]
            values = mean + likely[0::2, 0] + level * moved
            course = _Course(0.0, values, moved / np.sqrt(information), factor)
            found.append((evidence - float(np.log(factor[0]).sum()), course))
    share = np.exp(np.array([one for one, _ in found]) - max(one for one, _ in found))
    share = np.where(share > NEGLIGIBLE * share.sum(), share, 0.0)
    share /= share.sum()
    courses = tuple(replace(one, share=p) for p, (_, one) in zip(share.tolist(), found, strict=True) if p > 0)
    return Cleared(np.sum([one.share * one.values for one in courses], axis=0), courses)


def _process(steps: int, size: float, memory: float, step: float) -> tuple[np.ndarray, float]:
    """Precision of an Ornstein-Uhlenbeck process, (2, steps): diagonal, and beside it; and its log determinant."""
    decay = np.exp(-step / memory)
    fresh = size**2 * (1 - decay**2)
    diagonal = np.full(steps, (1 + decay**2) / fresh)
    diagonal[[0, -1]] = 1 / fresh
    logdet = -2 * np.log(size) - (steps - 1) * np.log(fresh)
    return np.stack([diagonal, np.append(np.full(steps - 1, -decay / fresh), 0.0)]), float(logdet)


def _joint(own: np.ndarray, slow: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Precision of the course and the slow noise given readings of their sum: in turn, (3, 2 steps) in banded form."""
    joint = np.zeros((3, 2 * len(weight)))
    joint[0, 0::2], joint[0, 1::2] = own[0] + weight, slow[0] + weight
    joint[1, 0::2] = weight
    joint[2, 0::2], joint[2, 1::2] = own[1], slow[1]
    return joint


def _held(readings: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Readings, those that were lost held from the one before: an actuator stays where it is."""
    last = np.maximum.accumulate(np.where(seen, np.arange(len(readings)), -1))
    return np.asarray(readings[np.where(last < 0, int(np.argmax(seen)), last)])


SHARED = 0.5
"""Share of the variance of what computed weather gets wrong that is the same throughout a recording: errors of the
formulas for a place and a season."""
SUN_OFF = 0.15
"""Standard error of a computed sun on a facade, as a share of it: 0.12 over three hours where a year of the shipped
weather is computed from its sun on the horizontal. Other ground and other haze come on top."""
SKY_OFF = 20.0
"""Standard error of a computed sky's radiation [W/m2]: 15 of a day with clouds fitted to the place, 24 of an hour
(Flerchinger et al. 2009, Water Resources Research 45:W03423)."""


@dataclass(frozen=True)
class Computed:
    """Weather that an import worked out of other readings, with the standard error ``sd`` (steps,) [its unit].

    It errs alike within ``pulse`` [s].
    """

    sd: np.ndarray
    pulse: float

    def covariance(self, weights: np.ndarray) -> np.ndarray:
        """Covariance of the errors of weighted means (means, steps), shape (means, means)."""
        sd = weights @ self.sd
        return np.asarray(np.outer(sd, sd) * (SHARED + (1 - SHARED) * np.eye(len(sd))))


def computed_weather(one: Input, values: np.ndarray) -> Computed | None:
    """How wrong computed values (steps,) of an input may be; None of one that is no weather which imports compute."""
    column = one.column if isinstance(one, WeatherInput) else None
    if column == "poa_global":
        return Computed(SUN_OFF * np.abs(values), METERED)
    if column == "temp_sky":
        return Computed(SKY_OFF / (4 * Stefan_Boltzmann * values**3), DAY)
    return None


LOST = 0.05
"""Share of an actuator's readings that may be bridged without a word."""


@dataclass(frozen=True)
class Drive:
    """All inputs of a system over a recording and its warm-up.

    ``signals`` by name in the order of the description; ``assumed`` says of each input that was not measured what
    stands in for it; ``replayed`` names the outputs whose measurement drives the model, which therefore tell nothing;
    ``begin`` is the start of the warm-up, ``start`` and ``stop`` those of the recording [s]; ``doubted`` by input: what
    was read of an actuator, where the description says how well, and weather that was computed.
    """

    signals: dict[str, Piecewise]
    assumed: dict[str, str]
    replayed: tuple[str, ...]
    begin: float
    start: float
    stop: float
    doubted: dict[str, Cleared | Computed] = field(default_factory=dict)


def drive(
    system: System,
    recording: Recording,
    *,
    warm_up: float,
    replay: bool = False,
    noise: Mapping[str, float] | None = None,
    occupancy: str | None = None,
) -> Drive:
    """Collect the inputs over a recording and ``warm_up`` seconds before it.

    What was not measured is taken from the description: constants and schedules as they are, excitation as none, and
    actuators where the FMU has controllers of its own, which ``[replay]`` would switch off. The occupancy is left at
    zero where it was not measured: see :mod:`diagnosis.fitting.nuisance`.

    Parameters
    ----------
    noise
        Standard deviation of each output's meter [unit of the output], which is cleared from what is replayed; none if
        not given.
    occupancy
        ``unknown`` leaves persons at zero that were counted.

    Raises
    ------
    RecordingError
        If the weather was not measured, or an actuator that is to be replayed or has no controller in the FMU.
    SystemDescriptionError
        If actuators are to be replayed and the system has none.
    """
    if replay and not any(one.source == "measured" for one in system.inputs):
        raise SystemDescriptionError(
            f"{system.path}: inputs: none has the source 'measured', so that there is no actuator to replay; expected"
            " one, or no replay"
        )
    lead = round(warm_up / recording.step)
    begin = recording.start - whole_days(recording, lead) * recording.step
    sought = [one.name for one in system.inputs if one.source == "measured"] if replay else []  # by :func:`_actuator`
    if lacking := sentence_on_missing(system, {*recording.inputs, *sought}):
        raise RecordingError(f"{recording.path}: {lacking}")
    signals: dict[str, Piecewise] = {}
    assumed: dict[str, str] = {}
    replayed = []
    doubted: dict[str, Cleared | Computed] = {}
    for one in system.inputs:
        values = recording.inputs.get(one.name)
        if one.source == "measured":
            if replay:
                meter = _actuator(system, recording, one, noise or {})
                values = meter.values
                replayed.append(one.column)
                if lost := _lost(system, recording, one):
                    assumed[one.name] = lost
                if meter.courses:
                    doubted[one.name] = meter
                if (values == one.value).all():
                    assumed[one.name] = f"{one.value:g} {one.unit} throughout"
            elif system.replay and (values is None or one.name in recording.assumed):
                assumed[one.name] = f"{one.value:g} {one.unit}, unused"  # the FMU's controllers act in its place
        if one.source == "occupancy" and occupancy == "unknown" and values is not None:
            signals[one.name] = Piecewise.constant(0.0)
            assumed[one.name] = "recorded, but not used: inferred with the prior of the description"
        elif values is not None:
            if one.name in recording.assumed and not (one.source == "measured" and replay):
                assumed.setdefault(one.name, recording.assumed[one.name])
            signals[one.name] = extended(recording, values, lead, held=one.interpolation == "previous")
            if one.name in recording.computed and (off := computed_weather(one, values)):
                doubted[one.name] = off
                assumed.setdefault(one.name, recording.computed[one.name])
        elif one.source == "schedule":
            signals[one.name] = schedule_signal(system.schedules[one.schedule], begin, recording.stop)
            assumed[one.name] = f"schedule {one.schedule!r} of the description"
        elif one.source == "occupancy":
            signals[one.name] = Piecewise.constant(0.0)
            assumed[one.name] = "unknown, inferred with the prior of the description"
        elif one.source == "excitation":
            signals[one.name] = Piecewise.constant(0.0)
            assumed[one.name] = "none"
        elif not isinstance(one, WeatherInput):  # which are recorded: see above
            signals[one.name] = Piecewise.constant(one.value)
            assumed.setdefault(one.name, f"{one.value:g} {one.unit} of the description")
    if unknown := [one.name for one in system.given if one.parameters and one.name not in recording.given]:
        assumed[", ".join(unknown)] = "not given by the recording, so the FMU's own"
    return Drive(signals, assumed, tuple(replayed), begin, recording.start, recording.stop, doubted)


def crowd(system: System, recording: Recording, wanted: str | None) -> str:
    """Whether persons were counted: ``measured``, ``unknown``, or ``none`` for a system without.

    Raises
    ------
    RecordingError
        If they are to be measured and were not recorded; if they are unknown, and several inputs read them.
    """
    names = [one.name for one in system.inputs if one.source == "occupancy"]
    if not names:
        return "none"
    seen = all(name in recording.inputs for name in names)
    if wanted == "measured" and not seen:
        raise RecordingError(
            f"{recording.path}: {', '.join(names)} was not recorded; expected it, or occupancy unknown"
        )
    if wanted not in (None, "measured", "unknown"):
        raise ValueError(f"occupancy is {wanted!r}; expected 'measured', 'unknown' or None")
    found = wanted or ("measured" if seen else "unknown")
    if found == "unknown" and len(names) > 1:
        # each would be given a crowd of its own, where a simulated system has one for all of them
        raise RecordingError(
            f"{recording.path}: persons were not counted or are not to be used, and {system.path} has"
            f" {len(names)} inputs for them ({', '.join(names)}); expected them recorded and used, or one such input"
        )
    return found


def driving(system: System, recording: Recording) -> tuple[str, ...]:
    """Outputs whose readings drive the model in replay: those of actuators that have no column of their own that moves.

    Such a column has no gaps (:func:`diagnosis.recording.read_recording`).
    """
    return tuple(
        one.column
        for one in system.inputs
        if one.source == "measured" and one.column in system.output_names and not _has_own(recording, one)
    )


def _has_own(recording: Recording, one: MeasuredInput) -> bool:
    """Whether an actuator was logged under its own name: what rests at the description's value throughout was not."""
    own = recording.inputs.get(one.name)
    return own is not None and not (own == one.value).all()


def _actuator(system: System, recording: Recording, one: MeasuredInput, noise: Mapping[str, float]) -> Cleared:
    """A measured actuator: its own column, or the output that measures it, cleared of the meter's noise."""
    own = recording.inputs.get(one.name)
    if own is not None and _has_own(recording, one):
        return cleared(own, noise.get(one.column, 0.0), recording.step)
    if one.column in system.output_names:
        readings = recording.outputs[system.output_names.index(one.column)]
        if np.isfinite(readings).any():
            return cleared(readings, noise.get(one.column, 0.0), recording.step)
    elif own is not None:  # the system has no such output: its recordings cannot say more than this
        return Cleared(own)
    raise RecordingError(f"{recording.path}: {one.name!r} (column {one.column!r}) was not recorded; replay needs it")


def _lost(system: System, recording: Recording, one: MeasuredInput) -> str:
    """A sentence on an actuator's meter of which much was lost; nothing if little was."""
    if one.column not in system.output_names or _has_own(recording, one):
        return ""
    gone = ~np.isfinite(recording.outputs[system.output_names.index(one.column)])
    if gone.mean() <= LOST:
        return ""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(int), [0]])))
    longest = float((edges[1::2] - edges[::2]).max()) * recording.step / HOUR
    return f"{gone.mean():.0%} of its meter's readings, bridged; the longest loss is {longest:.3g} h"


PULSE = 1800.0
"""Length of an occupancy pulse [s]: people come and go within the hour, and nobody knows when."""
HISTORY = (0.0, 0.25 * DAY, DAY, 3 * DAY)
"""Ends of the spans before the recording [s]; the last one reaches to the start of the warm-up."""
DRAWS = 4000
TINY = 1e-4
"""Share of the variance below which directions of the prior are left out."""
LEAST_PERSONS = 0.3
"""Of the largest standard deviation of unknown persons, the least at half hours of the day at which somebody may come.

They come at an unusual hour rarely, but then several at once: a normal prior with the variance of that takes the first
early comer of a Saturday for a gap of the model."""


def nuisance_of(
    system: System, recording: Recording, driven: Drive, *, occupancy: str
) -> tuple[Nuisance, dict[str, Piecewise]]:
    """The nuisance of a recording, and the signals that stand in for what it describes.

    Parameters
    ----------
    occupancy
        ``unknown``, ``measured``, or ``none`` for a system without.

    Returns
    -------
    tuple
        The pulses, whose heights are added to ``driven.signals`` updated by the second item.
    """
    parts, signals = [], {}
    for place, one in enumerate(system.inputs):
        if one.source == "occupancy" and occupancy == "unknown":
            part, signals[one.name] = _unknown_occupancy(system, place, driven)
        elif one.source == "measured" and one.name not in recording.inputs and not driven.replayed:
            continue
        else:
            signal = driven.signals[one.name]
            part = _history(place, driven, recording, signal)
            if one.source == "occupancy":
                assert system.occupancy is not None
                within, signals[one.name] = counted(system.occupancy, place, recording, signal)
                part = joined(within, part)
            elif one.source == "measured" and one.interpolation == "previous":
                part = joined(replayed(place, recording, signal), part)
        parts.append(part)
    return joined(*parts), signals


def _spans(driven: Drive) -> list[tuple[float, float]]:
    """Spans before the recording [s], nearest first."""
    ends = [driven.start - back for back in HISTORY if driven.start - back > driven.begin + SNAP]
    if not ends:  # no warm-up, no history
        return []
    return [(max(b, driven.begin), a) for a, b in zip(ends, [*ends[1:], driven.begin], strict=True)]


@dataclass(frozen=True)
class Courses:
    """Courses of the share of a room's persons that is there, as the description draws them, by pulses.

    ``begin``, ``end`` (pulses,) [s]: half hours of the recording at which somebody may come, then spans before it;
    ``recorded`` is how many are of the former; ``heights`` (courses, pulses), of spans before the recording against the
    usual; ``known`` what the rest of the signal is.
    """

    begin: np.ndarray
    end: np.ndarray
    recorded: int
    heights: np.ndarray
    known: Piecewise


def courses(system: System, driven: Drive) -> Courses:
    """Courses of the persons that nobody counted: always the same draws."""
    assert system.occupancy is not None
    back = round((driven.start - driven.begin) / PULSE)
    count = int(np.ceil((driven.stop - driven.start) / PULSE - 1e-9))
    edges = driven.start + PULSE * np.arange(-back, count + 1)
    drawn = prior_draw(system.occupancy, edges, DRAWS, seed=0)
    persons = np.maximum(headcounts(system.occupancy, drawn), 1.0)
    draws = occupancy_means(system.occupancy, drawn, edges) / persons[:, None]
    usual = draws.mean(axis=0)
    edges[-1] = driven.stop
    comes = draws[:, back:].std(axis=0) > TINY * max(draws.std(), 1e-12)
    hour = np.floor(edges[back:-1] % DAY / PULSE + 1e-6).astype(int)
    inside = back + np.flatnonzero(np.isin(hour, hour[comes]))
    begins, ends, heights = [edges[inside]], [edges[inside + 1]], [draws[:, inside]]
    for a, b in _spans(driven):
        rows = (edges[:-1] > a - PULSE / 2) & (edges[:-1] < b - PULSE / 2)
        if rows.any():
            begins.append(np.array([a]))
            ends.append(np.array([b]))
            heights.append((draws[:, rows] - usual[rows]).mean(axis=1, keepdims=True))
    known = np.where(np.isin(np.arange(back + count), inside), 0.0, usual)
    return Courses(
        begin=np.concatenate(begins),
        end=np.concatenate(ends),
        recorded=len(inside),
        heights=np.concatenate(heights, axis=1),
        known=Piecewise(edges[:-1], known, "previous"),
    )


def _unknown_occupancy(system: System, place: int, driven: Drive) -> tuple[Nuisance, Piecewise]:
    """Half-hourly persons in the recording and their means before it; the signal holds the usual day before it."""
    assert system.occupancy is not None
    fewest, most = system.occupancy.headcount
    found = courses(system, driven)
    covariance = np.atleast_2d(np.cov(found.heights, rowvar=False))
    variance = np.diag(covariance)[: found.recorded]
    rare = np.maximum(LEAST_PERSONS**2 * variance.max(initial=0.0) - variance, 0.0)
    covariance = covariance + np.diag(np.append(rare, np.zeros(len(covariance) - found.recorded)))
    return (
        Nuisance(
            column=np.full(len(found.begin), place),
            begin=found.begin,
            end=found.end,
            turns=np.zeros(len(found.begin), dtype=bool),
            recorded=found.begin > driven.start - SNAP,
            mean=found.heights.mean(axis=0),
            factor=_factor(covariance),
            levels=(Level(place, max(fewest - 0.5, 0.0), most + 0.5),),
        ),
        found.known,
    )


def _factor(covariance: np.ndarray) -> np.ndarray:
    """A factor F with F F' = covariance but for negligible directions, shape (n, rank)."""
    values, vectors = eigh(covariance)
    keep = values > TINY**2 * values[-1]
    return np.asarray(vectors[:, keep] * np.sqrt(values[keep]))


def _history(place: int, driven: Drive, recording: Recording, signal: Piecewise) -> Nuisance:
    """Offsets of an input before the recording, as much as such spans differ from day to day within it."""
    begin, end, spread = [], [], []
    for a, b in _spans(driven):
        found = _day_to_day(signal, recording, driven.start - b, min(b - a, DAY))
        if found > 0:
            begin.append(a)
            end.append(b)
            spread.append(found)
    return pulses_on(place, np.array(begin), np.array(end), np.diag(spread), recorded=False)


def _day_to_day(signal: Piecewise, recording: Recording, back: float, length: float) -> float:
    """Standard deviation over days of the difference between a span of the day and that of the day repeated."""
    grid = np.arange(recording.start, recording.stop, min(recording.step, HOUR)) + 0.5 * min(recording.step, HOUR)
    values = signal.at(grid)
    day = round(DAY / (grid[1] - grid[0]))
    days = len(values) // day
    if days < 3:  # too few days to compare: all of its variation
        return float(values.std())
    first = round((DAY - back % DAY - length) % DAY / DAY * day)
    width = max(round(length / DAY * day), 1)
    rolled = np.roll(values[: days * day], -first)[: days * day].reshape(days, day)[:, :width].mean(axis=1)
    return float(np.sqrt(2) * rolled.std())
