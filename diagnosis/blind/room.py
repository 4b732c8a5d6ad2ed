"""The true room: a system, what is true of it, and its simulation on fine steps.

What drives the truth: random processes of occupants, neighbours and weather, as signals.

Times are seconds since time zero; every process is drawn over the whole span of the simulation, warm-up included.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from datagen.driving.tables import SNAP, InputTable, Piecewise, followed, merge
from datagen.simulating.simulator import Simulator
from diagnosis.blind.truth import Daily, Damped, Driven, Episodes, Fault, Glare, Hump, Occupant, Process, Spans, Wander
from diagnosis.effects.kinds import lagged
from diagnosis.effects.shapes import joined
from diagnosis.recording import DAY, HOUR
from shared.variables import ZERO_CELSIUS

Random = Callable[[str], np.random.Generator]
"""The stream of randomness for a purpose."""


def autoregressive(rng: np.random.Generator, count: int, memory: float) -> np.ndarray:
    """A stationary AR(1) series of unit variance whose correlation falls to 1/e in ``memory`` steps, shape (count,)."""
    phi = np.exp(-1.0 / memory)
    white = rng.standard_normal(count)
    white[1:] *= np.sqrt(1.0 - phi**2)
    return followed(white, phi)


def wandering(rng: np.random.Generator, start: float, stop: float, hours: float) -> Piecewise:
    """An AR(1) series of unit variance and correlation time ``hours``, hourly from ``start`` to ``stop`` [s].

    Equal streams and spans make equal paths, whether an input takes them or a sensor's error.
    """
    every = np.arange(np.floor(start / HOUR), np.ceil(stop / HOUR) + 1)
    return Piecewise(every * HOUR, autoregressive(rng, len(every), hours))


def signals_of(table: InputTable) -> dict[str, Piecewise]:
    """The inputs of a table as signals again: steps where each is level between knots, straight lines elsewhere."""
    signals = {}
    for k, name in enumerate(table.names):
        left, right = table.left[:, k], table.right[:, k]
        if (left == right).all():
            changes = np.flatnonzero(np.diff(left)) + 1
            keep = np.concatenate([[0], changes])
            signals[name] = Piecewise(table.time[keep], left[keep], "previous")
        else:
            signals[name] = Piecewise(table.time, np.append(left, right[-1]))
    return signals


def drive(
    one: Driven, amplitude: float, signals: Mapping[str, Piecewise], start: float, stop: float, rng: np.random.Generator
) -> Piecewise:
    """The true input: the process in place of what is recorded, or what is recorded changed by it."""
    made = process_signal(one.process, signals, start, stop, rng)
    size = amplitude * one.amount
    old = signals[one.input]
    match one.use:
        case "set":
            return made
        case "add":
            return joined(old, made, lambda x, y: x + size * y)
        case "gain":
            return joined(old, made, lambda x, y: x * (1.0 + size * y))
        case "shift":
            times = old.times + size * made.at(old.times)
            times, keep = np.unique(np.maximum.accumulate(times), return_index=True)
            return Piecewise(times, old.values[keep], old.kind)


def process_signal(
    process: Process, signals: Mapping[str, Piecewise], start: float, stop: float, rng: np.random.Generator
) -> Piecewise:
    """One process over ``start`` to ``stop``; an occupant's window is closed here, and opened by the simulation."""
    if isinstance(process, Occupant):
        return Piecewise.constant(0.0)
    if isinstance(process, Spans):
        return _spans(process, start, stop, rng)
    if isinstance(process, Episodes):
        return _episodes(process, signals[process.presence], start, stop, rng)
    if isinstance(process, Glare):
        return _glare(process, signals, start, stop, rng)
    if isinstance(process, Wander):
        path = wandering(rng, start, stop, process.hours)
        return Piecewise(path.times, np.clip(process.mean + process.sd * path.values, process.low, process.high))
    hours = np.arange(np.floor(start / HOUR), np.ceil(stop / HOUR) + 1)
    times = hours * HOUR
    if isinstance(process, Daily):
        swing = process.swing * np.cos(2 * np.pi * (hours - process.peak) / 24)
        return Piecewise(times, process.mean + swing + process.sd * autoregressive(rng, len(hours), process.hours))
    if isinstance(process, Hump):
        away = (hours - process.peak + 12) % 24 - 12
        return Piecewise(times, np.exp(-0.5 * (away / process.width) ** 2))
    return _damped(process, signals, times)


def _damped(process: Damped, signals: Mapping[str, Piecewise], times: np.ndarray) -> Piecewise:
    top = signals[process.series].at(times) / process.reference if process.series else np.ones_like(times)
    return Piecewise(times, top / (1.0 + np.maximum(signals[process.by].at(times), 0.0) / process.by_reference))


def _steps(begins: np.ndarray, ends: np.ndarray, levels: np.ndarray, start: float) -> Piecewise:
    """Steps to a level from each beginning to its end; where two overlap the higher level holds."""
    order = np.argsort(begins, kind="stable")
    begins, ends, levels = begins[order], ends[order], levels[order]
    times = np.unique(np.concatenate([[start - DAY], begins, ends]))
    times = times[np.diff(times, prepend=-np.inf) > SNAP]
    values = np.zeros(len(times))
    for begin, end, level in zip(begins, ends, levels, strict=True):
        now = (times >= begin - SNAP) & (times < end - SNAP)
        values[now] = np.maximum(values[now], level)
    return Piecewise(times, values, "previous")


def _spans(process: Spans, start: float, stop: float, rng: np.random.Generator) -> Piecewise:
    days = np.arange(np.floor(start / DAY) - 1, np.ceil(stop / DAY))
    begins, ends, levels = [], [], []
    for first, last in process.hours:
        happens = rng.random(len(days)) < process.probability
        if process.days == "weekday":
            happens &= days.astype(np.int64) % 7 < 5
        begin = days * DAY + (first + process.jitter * rng.standard_normal(len(days))) * HOUR
        length = (last - first) % 24 + process.jitter * rng.standard_normal(len(days))
        end = begin + np.maximum(length, 0.2) * HOUR
        level = rng.uniform(*process.level, len(days))
        begins.append(begin[happens])
        ends.append(end[happens])
        levels.append(level[happens])
    return _steps(np.concatenate(begins), np.concatenate(ends), np.concatenate(levels), start)


def _episodes(process: Episodes, presence: Piecewise, start: float, stop: float, rng: np.random.Generator) -> Piecewise:
    count = rng.poisson(process.rate * (stop - start) / HOUR)
    begins = np.sort(rng.uniform(start, stop, count))
    lengths = rng.uniform(*process.hours, count) * HOUR
    levels = rng.uniform(*process.level, count)
    there = presence.at(begins) > 0
    return _steps(begins[there], begins[there] + lengths[there], levels[there], start)


def _glare(
    process: Glare, signals: Mapping[str, Piecewise], start: float, stop: float, rng: np.random.Generator
) -> Piecewise:
    times = np.arange(np.floor(start / HOUR), np.ceil(stop / HOUR)) * HOUR
    light, persons = signals[process.series].at(times), signals[process.presence].at(times)
    limits, stays = rng.uniform(*process.limit, len(times)), rng.random(len(times)) < process.patience
    closed, values, opened_on = False, np.zeros(len(times)), -1.0
    for k, time in enumerate(times):
        day = np.floor(time / DAY)
        if persons[k] > 0:
            if closed and day > opened_on and light[k] < limits[k]:
                closed, opened_on = bool(stays[k]), day  # the first look of a day decides
            if light[k] > limits[k]:
                closed, opened_on = True, day
        values[k] = float(closed)
    return Piecewise(times, values, "previous")


class Window:
    """An occupant's window, asked hour after hour; see :class:`diagnosis.blind.truth.Occupant`."""

    def __init__(self, process: Occupant, signals: Mapping[str, Piecewise], rng: np.random.Generator) -> None:
        self.process, self.signals, self.rng = process, signals, rng
        self.opening, self.alone = 0.0, False

    def __call__(self, time: float, room: float) -> float:
        """The opening over the hour from ``time`` [s], at a room temperature [K]: 0 to 1."""
        p = self.process
        chance, size, leaves = self.rng.random(3)
        if self.signals[p.presence].at(time) <= 0:
            if not self.alone and leaves > p.forgets:
                self.opening = 0.0
            self.alone = True
            return self.opening
        self.alone = False
        outdoor = float(self.signals[p.outdoor].at(time)) - ZERO_CELSIUS
        odds = p.offset + p.indoors * (room - ZERO_CELSIUS) + p.outdoors * outdoor
        if self.opening > 0 and room < p.cold:
            self.opening = 0.0
        elif self.opening == 0 and chance < expit(odds):
            self.opening = 0.3 + 0.7 * size
        return self.opening


def erring(
    fault: Fault,
    size: float,
    y: np.ndarray,
    time: np.ndarray,
    followed: Mapping[str, np.ndarray | Piecewise],
    path: Piecewise,
) -> np.ndarray:
    """What a sensor with a fault shows, shape (steps,) [unit of the output].

    Parameters
    ----------
    size
        Amplitude * ``amount``.
    y
        What is there, shape (steps,) [unit of the output].
    time
        Ends of the steps [s].
    followed
        States of the FMU (steps,), inputs and weather columns by name.
    path
        The fault's wander: see :func:`diagnosis.blind.room.wandering`.
    """
    step, elapsed = float(time[1] - time[0]), time - time[0]
    match fault.kind:
        case "wander":
            return np.asarray(y + size * (1.0 + fault.sd * path.at(time)))
        case "walk":
            days = elapsed / DAY
            trend = (1.0 - np.exp(-days / 15.0)) / (1.0 - np.exp(-2.0))
            hourly = time[0] + HOUR * np.arange(np.ceil(elapsed[-1] / HOUR) + 1)
            unit = np.sqrt(2.0 * fault.hours * 30.0 * 24.0)  # the standard deviation after thirty days
            walk = np.cumsum(path.at(hourly)) / unit
            return y + size * (trend + fault.sd * np.interp(time, hourly, walk))
        case "curve":
            away = y - fault.about
            return np.asarray(y + size * away * np.abs(away) / fault.span)
        case "slow":
            return lagged(lagged(y, size / 2.0, step), size / 2.0, step)
        case "clock":
            return np.interp(time + size * (0.5 + elapsed / elapsed[-1]), time, y)
        case "state":
            return np.asarray(y + size * (followed[fault.series] - y))
        case "series":
            series = followed[fault.series]
            x = series.at(time) if isinstance(series, Piecewise) else series
            return np.asarray(y + size * (x - fault.origin) / fault.reference)


@dataclass(frozen=True)
class Lived:
    """What happened in the room.

    ``time`` (steps,) ends of fine steps [s], ``outputs`` (outputs, steps) [unit of each], ``states`` by name, each
    (steps,).
    """

    time: np.ndarray
    outputs: np.ndarray
    states: dict[str, np.ndarray]


def live(
    simulator: Simulator,
    parameters: Mapping[str, float],
    signals: Mapping[str, Piecewise],
    *,
    begin: float,
    stop: float,
    step: float,
    tolerance: float,
    window: tuple[str, str, Window] | None = None,
) -> Lived:
    """Simulate from ``begin`` to ``stop`` and record every ``step`` (all [s]).

    ``window``: the input that an occupant sets every full hour, the output that tells the occupant how warm it is, and
    the occupant. The simulation then goes hour by hour, each from the states that the last one left.

    Raises
    ------
    SimulationError
        If the end was not reached.
    """
    system = simulator.system
    names = [derivative.variable.derivative.name for derivative in simulator.fmu.description.derivatives]
    table = merge({name: signals[name] for name in system.input_names}, begin, stop)
    if window is None:
        made = simulator.run(
            parameters,
            table,
            start=begin,
            stop=stop,
            step=step,
            tolerance=tolerance,
            record_states=True,
        )
        return Lived(made.time, made.outputs, dict(zip(names, made.states[1:].T, strict=True)))
    target, room, occupant = window
    column, row = table.names.index(target), system.output_names.index(room)
    times, outputs, states = [], [], []
    last: np.ndarray | None = None
    feels = 294.15  # before the first hour nobody has felt anything yet: an ordinary room
    for hour in np.arange(begin, stop - 1.0, HOUR):
        part = _held(table.restricted(hour, hour + HOUR), column, occupant(float(hour), feels))
        made = simulator.run(
            parameters,
            part,
            start=float(hour),
            stop=float(hour + HOUR),
            step=step,
            tolerance=tolerance,
            initial_states=last,
            record_states=True,
        )
        last, feels = made.states[-1], float(made.outputs[row, -1])
        times.append(made.time)
        outputs.append(made.outputs)
        states.append(made.states[1:])
    return Lived(
        np.concatenate(times),
        np.concatenate(outputs, axis=1),
        dict(zip(names, np.concatenate(states).T, strict=True)),
    )


def _held(table: InputTable, column: int, value: float) -> InputTable:
    """The table with one input held at a value."""
    left, right = table.left.copy(), table.right.copy()
    left[:, column] = right[:, column] = value
    return replace(table, left=left, right=right)


def coarse(outputs: np.ndarray, methods: list[str], ratio: int) -> np.ndarray:
    """Outputs (outputs, fine steps) on steps that are ``ratio`` times longer: the last instant, or the mean."""
    blocks = outputs.reshape(len(outputs), -1, ratio)
    points = np.array([method == "point" for method in methods])
    return np.where(points[:, None], blocks[:, :, -1], blocks.mean(axis=2))
