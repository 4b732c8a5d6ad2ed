"""Causes for calibrating a diagnosis: candidates by random laws of their own, and processes that no candidate has.

A candidate's law is never quite the building's. So what a candidate changes is multiplied by a random course of time:
it wanders, keeps hours of the day, or begins midway. A cause outside the library is a random process where something
may be missing: at one of the description's sources, at a weather input, or at a sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from datagen.driving.tables import Piecewise
from diagnosis.blind.room import wandering
from diagnosis.effects import Effect, Nothing
from diagnosis.effects.shapes import joined
from diagnosis.recording import DAY, HOUR, Recording
from shared.system import System

EXACT = 0.25
"""Share of the candidates' causes that act by the candidate's own law."""
SPREAD = 0.8
"""Greatest spread of a course that wanders [of its logarithm]."""
MEMORY = (2.0, 72.0)
"""Correlation times [h]."""
IN_TIME = ("shift", "lag")
"""Operations that move in time: half of what they do is no smaller move."""


@dataclass(frozen=True)
class Span:
    """When a room is simulated [s]: from ``begin``, recorded from ``start``, to ``stop``."""

    begin: float
    start: float
    stop: float


@dataclass(frozen=True)
class Warped:
    """A candidate whose doing is multiplied by a course of time.

    What it does by parameters alone no input can be multiplied for: :attr:`by_parameters` says so.
    """

    effect: Effect
    course: Piecewise
    inputs_of_system: frozenset[str]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "effect":
            raise AttributeError(name)
        return getattr(self.effect, name)

    @property
    def by_parameters(self) -> bool:
        """Whether it changes neither inputs nor outputs."""
        return not any(one in self.inputs_of_system or one.startswith("output:") for one in self.effect.changes)

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """The inputs with what the candidate changes, as far as the course lets it."""
        changed = self.effect.inputs(amplitude, inputs, recording)
        return {
            name: one if one is inputs[name] else _as_far(inputs[name], one, self.course)
            for name, one in changed.items()
        }

    def outputs(self, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
        """What the sensors show, as far as the course lets the candidate, shape (outputs, steps) [unit of each]."""
        changed = self.effect.outputs(amplitude, outputs, time)
        return np.asarray(outputs + self.course.at(time) * (changed - outputs))


def warped(effect: Effect, system: System, course_of: Piecewise) -> Effect | Warped:
    """A candidate by another law; what moves in time keeps its own."""
    operation = getattr(getattr(effect, "spec", None), "operation", "")
    return effect if operation in IN_TIME else Warped(effect, course_of, frozenset(system.input_names))


@dataclass(frozen=True)
class Process(Nothing):
    """A process that is added to an input or an output (``output``: its row), by its amplitude.

    ``port``: the input's name, or ``output:`` and the output's, as candidates tell what they change. ``settings``: what
    lets an input act. An input that varies and is never negative stays so.
    """

    course: Piecewise = field(default_factory=lambda: Piecewise.constant(0.0))
    port: str = ""
    output: int = -1
    settings: tuple[tuple[str, float], ...] = ()

    @property
    def changes(self) -> frozenset[str]:
        """Its port."""
        return frozenset({self.port})

    @property
    def follows(self) -> frozenset[str]:
        """No output."""
        return frozenset()

    def parameters(self, amplitude: float) -> dict[str, float]:
        """What lets the input act."""
        return dict(self.settings)

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """The inputs with the process on one of them."""
        if self.output >= 0:
            return inputs
        old = inputs[self.port]
        least = 0.0 if np.ptp(old.values) > 0 and old.values.min() >= 0 else -np.inf
        return {**inputs, self.port: joined(old, self.course, lambda x, y: np.maximum(x + amplitude * y, least))}

    def outputs(self, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
        """What the sensors show."""
        if self.output < 0:
            return outputs
        shown = np.array(outputs, dtype=float)
        shown[self.output] += amplitude * self.course.at(time)
        return shown

    def of_spread(self, signals: Mapping[str, Piecewise]) -> Process:
        """The same with the spread of what it is added to as its scale; one where that is constant."""
        spread = float(np.std(signals[self.port].values)) if self.port in signals else 0.0
        return replace(self, scale=spread) if self.output < 0 and spread > 0 else self


def course(rng: np.random.Generator, span: Span) -> Piecewise:
    """A course about 1 that is never negative, hourly: what a law is multiplied by."""
    spread = SPREAD * rng.random()
    wander = wandering(rng, span.begin, span.stop, _memory(rng))
    values = np.exp(spread * wander.values - 0.5 * spread**2)
    return Piecewise(wander.times, values * _some_hours(rng, wander.times, span), "previous")


def process(rng: np.random.Generator, span: Span) -> Piecewise:
    """A process that wanders or follows the day about an offset, all of order one, hourly; or at some hours only."""
    wander = wandering(rng, span.begin, span.stop, _memory(rng))
    daily = np.cos(2 * np.pi * (wander.times / DAY - rng.random()))
    share = rng.random()
    values = np.sqrt(share) * wander.values + np.sqrt(2 * (1 - share)) * daily + rng.normal()
    return Piecewise(wander.times, values * _some_hours(rng, wander.times, span), "previous")


def outside(system: System, rng: np.random.Generator, span: Span, noise: str, *, unknown: bool) -> Process:
    """A process of a source, of a weather input, or of a sensor, whose scale is its noise.

    Parameters
    ----------
    noise
        The preset whose noise is a sensor's scale.
    unknown
        Whether persons are not counted: what is added to them is then no cause, but who was there.
    """
    made = process(rng, span)
    persons = {one.name for one in system.inputs if one.source == "occupancy"} if unknown else set()
    ports = [
        Process(one.name, course=made, port=one.input, settings=tuple(one.parameters.items()))
        for one in system.sources
        if one.input not in persons
    ]
    weather = [one for one in system.inputs if one.source == "weather"]
    ports += [Process(one.name, one.unit, course=made, port=one.name) for one in weather]
    for row, (one, sd) in enumerate(zip(system.outputs, system.noise_sd(noise).tolist(), strict=True)):
        ports.append(Process(one.name, one.unit, sd, course=made, port=f"output:{one.name}", output=row))
    return ports[int(rng.integers(len(ports)))]


def _memory(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(MEMORY))))


def _some_hours(rng: np.random.Generator, times: np.ndarray, span: Span) -> np.ndarray:
    """Ones (times,); for some laws ones at hours of every day, or from some time of the recording on, zeros else."""
    kind = rng.random()
    first, length = 24.0 * rng.random(), rng.uniform(6.0, 16.0)
    begins = span.start + rng.uniform(0.2, 0.7) * (span.stop - span.start)
    if kind < 0.3:
        return np.asarray(((times / HOUR - first) % 24.0 < length).astype(float))
    return np.asarray((times >= begins).astype(float)) if kind < 0.4 else np.ones(len(times))


def _as_far(old: Piecewise, new: Piecewise, course: Piecewise) -> Piecewise:
    difference = joined(old, new, lambda x, y: y - x)
    return joined(old, joined(difference, course, np.multiply), np.add)
