"""Causes for calibrating a diagnosis: candidates by random laws of their own, and processes that no candidate has.

A candidate's law is never quite the building's. So what a candidate changes is multiplied by a random course of time:
it wanders, keeps hours of the day, or begins midway. A cause outside the library is a random process where something
may be missing: at one of the description's sources, at a weather input, or at a sensor.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from datagen.driving.tables import Piecewise
from diagnosis.blind.processes import wandering
from diagnosis.effects import Effect, Nothing, moved_in_time
from diagnosis.effects.shapes import joined
from diagnosis.recording import DAY, HOUR, Recording
from shared.system import System

EXACT = 0.25
"""Share of the candidates' causes that act by the candidate's own law."""
SPREAD = 0.8
"""Greatest spread of a course that wanders [of its logarithm]."""
MEMORY = (2.0, 72.0)
"""Correlation times [h]."""


@dataclass(frozen=True)
class Warped:
    """A candidate whose doing is multiplied by a course of time; what it moves in time is moved as it says."""

    effect: Effect
    course: Piecewise

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "effect":
            raise AttributeError(name)
        return getattr(self.effect, name)

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """The inputs with what the candidate changes, as far as the course lets it."""
        changed = self.effect.inputs(amplitude, inputs, recording)
        moved = moved_in_time(self.effect)
        return {
            name: one if name in moved or one is inputs[name] else _as_far(inputs[name], one, self.course)
            for name, one in changed.items()
        }

    def outputs(self, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
        """What the sensors show, as far as the course lets the candidate, shape (outputs, steps) [unit of each]."""
        changed = self.effect.outputs(amplitude, outputs, time)
        return np.asarray(outputs + self.course.at(time) * (changed - outputs))


@dataclass(frozen=True)
class Process(Nothing):
    """A process that is added to an input (in its ``per`` unit) or an output (``output``: its row), by its amplitude.

    ``port``: the input's name or ``output:`` and the output's, as candidates tell what they change.
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
        added = joined(inputs[self.port], self.course, lambda x, y: x + amplitude * y)
        return {**inputs, self.port: added}

    def outputs(self, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
        """What the sensors show."""
        if self.output < 0:
            return outputs
        shown = np.array(outputs, dtype=float)
        shown[self.output] += amplitude * self.course.at(time)
        return shown


def course(rng: np.random.Generator, begin: float, stop: float) -> Piecewise:
    """A course about 1 that is never negative, hourly between two times [s]: what a law is multiplied by."""
    spread = SPREAD * rng.random()
    wander = wandering(rng, begin, stop, _memory(rng))
    values = np.exp(spread * wander.values - 0.5 * spread**2)
    return Piecewise(wander.times, values * _some_hours(rng, wander.times), "previous")


def process(rng: np.random.Generator, begin: float, stop: float) -> Piecewise:
    """A process about 0 of unit variance, or one that is there for some hours, hourly between two times [s]."""
    wander = wandering(rng, begin, stop, _memory(rng))
    daily = np.cos(2 * np.pi * (wander.times / DAY - rng.random()))
    share = rng.random()
    values = np.sqrt(share) * wander.values + np.sqrt(2 * (1 - share)) * daily
    return Piecewise(wander.times, (values + rng.normal()) * _some_hours(rng, wander.times), "previous")


def outside(system: System, rng: np.random.Generator, begin: float, stop: float, noise: str) -> Process:
    """A cause that no candidate has, of a scale of one: of a source, of a weather input, or of a sensor's noise.

    Parameters
    ----------
    begin, stop
        Of the simulation [s].
    noise
        The preset whose noise is a sensor's scale.
    """
    made = process(rng, begin, stop)
    ports = [
        Process(one.name, course=made, port=one.input, settings=tuple(one.parameters.items())) for one in system.sources
    ]
    ports += [
        Process(one.name, one.unit, course=made, port=one.name) for one in system.inputs if one.source == "weather"
    ]
    for row, one in enumerate(system.outputs):
        scale = max(one.noise[noise].sd if noise in one.noise else 0.0, one.accuracy)
        ports.append(Process(one.name, one.unit, scale, course=made, port=f"output:{one.name}", output=row))
    return ports[int(rng.integers(len(ports)))]


def _memory(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(*np.log(MEMORY))))


def _some_hours(rng: np.random.Generator, times: np.ndarray) -> np.ndarray:
    """Ones (times,); for some laws ones at hours of every day, or from some time on, and zeros before."""
    kind = rng.random()
    first, length = 24.0 * rng.random(), rng.uniform(6.0, 16.0)
    begins = times[0] + rng.uniform(0.3, 0.7) * (times[-1] - times[0])
    if kind < 0.3:
        return np.asarray(((times / HOUR - first) % 24.0 < length).astype(float))
    return np.asarray((times >= begins).astype(float)) if kind < 0.4 else np.ones(len(times))


def _as_far(old: Piecewise, new: Piecewise, course: Piecewise) -> Piecewise:
    difference = joined(old, new, lambda x, y: y - x)
    return joined(old, joined(difference, course, np.multiply), np.add)
