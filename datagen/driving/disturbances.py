"""Effects that act on simulated systems, so that an estimator has seen rooms that are not quite the model.

Which of the description's effects act, how strongly and when is random. What a shape says in the description is not
used: a process or a timetable of its own drives each, so that an estimator learns to allow for what nobody modelled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from datagen.driving.sampling import stream
from datagen.driving.tables import Piecewise, followed
from shared.effects import InputEffect, ParameterEffect, SensorEffect, ShapedEffect
from shared.system import System

HOUR = 3600.0
DAY = 24 * HOUR
STRENGTH = 2.0
"""Standard deviation of amplitudes, in units of the effect's own scale: also what is large shall be covered."""
Change = Callable[[Piecewise], Piecewise]


@dataclass
class Disturbances:
    """What acts on one system beside the model: FMU parameters, changes of inputs, and errors of sensors."""

    names: list[str] = field(default_factory=list)
    parameters: dict[str, float] = field(default_factory=dict)
    changes: dict[str, list[Change]] = field(default_factory=dict)
    sensors: list[tuple[SensorEffect, float]] = field(default_factory=list)

    def applied(self, system: System, time: np.ndarray, outputs: np.ndarray) -> np.ndarray:
        """Outputs (outputs, steps) [unit of each] at times (steps,) [s] as erring sensors show them."""
        shown = outputs.copy()
        for effect, amplitude in self.sensors:
            for name in effect.outputs:
                k = system.output_names.index(name)
                shown[k] = _read_by(effect, amplitude * effect.factor, time, shown[k])
        return shown


def number_of(root_seed: int, index: int, share: float) -> int:
    """How many effects act on a system: none, or in a share of the systems one or two."""
    u = float(stream(root_seed, index, "disturbed").random())
    return 0 if u >= share else 1 + int(u < 0.3 * share)


def sample_disturbances(
    system: System, root_seed: int, index: int, share: float, start: float, stop: float
) -> Disturbances:
    """Draw what acts on a system from ``start`` to ``stop`` [s since time zero].

    On a ``share`` of the systems something does.
    """
    made = Disturbances()
    possible = [one for one in system.effects if "control" in one.modes]
    count = number_of(root_seed, index, share)
    if not count or not possible:
        return made
    rng = stream(root_seed, index, "disturbances")
    for k in rng.permutation(len(possible))[:count]:
        effect = possible[k]
        size = STRENGTH * effect.scale * rng.standard_normal()
        amplitude = float(np.clip(abs(size) if effect.lower == 0 else size, effect.lower, effect.upper))
        made.names.append(effect.name)
        shape = _shape(rng, start, stop)
        if isinstance(effect, ParameterEffect | ShapedEffect):
            base = getattr(effect, "base", {})
            for name, slope in effect.parameters.items():
                made.parameters[name] = base.get(name, 0.0) + amplitude * slope
            made.parameters |= effect.constants
            if isinstance(effect, ShapedEffect):
                made.changes.setdefault(effect.input, []).append(_replaced(shape))
        elif isinstance(effect, InputEffect):
            change = amplitude * effect.factor
            varied = shape if effect.shape or rng.random() < 0.3 else None
            made.changes.setdefault(effect.input, []).append(_changed(effect, change, varied))
        elif isinstance(effect, SensorEffect):
            made.sensors.append((effect, amplitude))
            for name in effect.fed_back:
                made.changes.setdefault(name, []).append(_added(-amplitude * effect.factor))
    return made


def _shape(rng: np.random.Generator, start: float, stop: float) -> Piecewise:
    """A course from 0 to 1: a timetable of its own, or a process in time."""
    if rng.random() < 0.5:
        first, length = rng.uniform(0, 24), rng.uniform(1, 14)
        days = np.arange(np.floor(start / DAY) - 1, np.ceil(stop / DAY) + 1)
        if rng.random() < 0.5:
            days = days[days % 7 < 5]
        days = days[rng.random(len(days)) < rng.uniform(0.5, 1.0)]
        if not len(days):
            return Piecewise.constant(0.0)
        times = (days[:, None] * DAY + np.array([first, first + length]) * HOUR).ravel()
        return Piecewise(times, np.tile([1.0, 0.0], len(days)), "previous")
    times = np.arange(np.floor(start / HOUR), np.ceil(stop / HOUR) + 1) * HOUR
    keep = np.exp(-1.0 / rng.uniform(2.0, 72.0))
    noise = rng.standard_normal(len(times)) * np.sqrt(1 - keep**2)
    noise[0] /= np.sqrt(1 - keep**2)
    process = followed(noise, keep)
    return Piecewise(times, 1.0 / (1.0 + np.exp(-2.0 * process + rng.normal())))


def _replaced(shape: Piecewise) -> Change:
    return lambda _: shape


def _added(amount: float) -> Change:
    return lambda signal: Piecewise(signal.times, signal.values + amount, signal.kind)


def _changed(effect: InputEffect, change: float, shape: Piecewise | None) -> Change:
    """``change`` is the amplitude times the effect's factor."""

    def change_of(signal: Piecewise) -> Piecewise:
        if effect.operation == "shift":
            return Piecewise(signal.times + change, signal.values, signal.kind)
        # an input that is constant has one knot only: the course brings its own
        times = signal.times if shape is None or len(signal.times) > 1 else np.union1d(signal.times, shape.times)
        values, acting = signal.at(times), change * (1.0 if shape is None else shape.at(times))
        kind = signal.kind if shape is None or len(signal.times) > 1 else shape.kind
        changed = values * np.maximum(1.0 + acting, 0.0) if effect.operation == "gain" else values + acting
        return Piecewise(times, changed, kind)

    return change_of


def _read_by(effect: SensorEffect, change: float, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What an erring sensor shows of values (steps,) at times (steps,) [s]."""
    if effect.operation == "bias":
        return values + change
    if effect.operation == "gain":
        return values + change * (values - effect.about)
    if effect.operation == "drift":
        return values + change * (time - time[0]) / (30 * DAY)
    if effect.operation == "shift":
        return np.interp(time - change, time, values)
    step = float(time[1] - time[0]) if len(time) > 1 else HOUR
    keep = np.exp(-step / change) if change > 0 else 0.0
    return followed((1 - keep) * values, keep, before=values[0])


def changed_signals(signals: Mapping[str, Piecewise], changes: Mapping[str, list[Change]]) -> dict[str, Piecewise]:
    """Signals by the name of their input, after the changes that disturbances make."""
    found = dict(signals)
    for name, each in changes.items():
        for change in each:
            found[name] = change(found[name])
    return found
