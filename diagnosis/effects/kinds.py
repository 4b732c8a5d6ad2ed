"""The generic kinds of effects: what the system's TOML declares, made to act. None knows a variable's name."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from datagen.driving.tables import Piecewise
from diagnosis.effects.base import Idle
from diagnosis.effects.shapes import joined, shape_signal
from diagnosis.recording import DAY, Recording
from shared.effects import DiurnalShape, InputEffect, ParameterEffect, SensorEffect, Shape, ShapedEffect, TimetableShape

Declared = ParameterEffect | ShapedEffect | InputEffect | SensorEffect


MOST = 0.25
"""An effect that would invent more than this share of an output's readings is not tried."""


@dataclass(frozen=True)
class DeclaredKind(Idle):
    """An effect that was declared, and has its name, bounds and so on; ``output_names`` are the system's, in its order.

    ``means``: outputs that are means over the recording's steps.
    """

    spec: Declared
    output_names: tuple[str, ...]
    means: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        # as attributes of its own: what is only found by __getattr__ is no part of a protocol to isinstance
        vars(self).update({name: getattr(self.spec, name) for name in Idle.__annotations__})

    @property
    def owns(self) -> frozenset[str]:
        """What no other effect may set at the same time."""
        return frozenset()

    @property
    def changes(self) -> frozenset[str]:
        """What the effect touches."""
        return self.owns

    @property
    def follows(self) -> frozenset[str]:
        """Measured outputs that the effect's shapes follow: without them it has no meaning."""
        shapes = [shape for shape in self._shapes() if not isinstance(shape, TimetableShape | DiurnalShape)]
        return frozenset(shape.series for shape in shapes) & frozenset(self.output_names)

    def obstacle(self, recording: Recording, *, replay: bool) -> str:
        """Why the effect cannot be tried on this recording, in one clause; empty if it can."""
        if ("replay" if replay else "control") not in self.spec.modes:
            return "measured actuators leave it no way to act" if replay else "it acts in replay only"
        for name in sorted(self.follows):
            if not np.isfinite(recording.outputs[self.output_names.index(name)]).any():
                return f"{name} was not measured"
        if (self.invented(recording.time).mean(axis=1) > MOST).any():
            return "it may take more than a quarter of the readings from beyond the recording"
        return ""

    def invented(self, time: np.ndarray) -> np.ndarray:
        """Readings, shape (outputs, steps), that some amplitude takes from beyond the recording's ``time`` (steps,)."""
        return np.zeros((len(self.output_names), len(time)), dtype=bool)

    def _shapes(self) -> list[Shape]:
        return []


@dataclass(frozen=True)
class FmuParameters(DeclaredKind):
    """Parameters of the FMU, each linear in the amplitude."""

    spec: ParameterEffect | ShapedEffect

    @property
    def owns(self) -> frozenset[str]:
        """Its parameters."""
        return frozenset({*self.spec.parameters, *self.spec.constants})

    def parameters(self, amplitude: float) -> dict[str, float]:
        """``base`` + amplitude * ``parameters``, and the constants [unit of each]; empty at zero."""
        if amplitude == 0:
            return {}
        base = self.spec.base if isinstance(self.spec, ParameterEffect) else {}
        moved = {name: base.get(name, 0.0) + amplitude * each for name, each in self.spec.parameters.items()}
        return {**self.spec.constants, **moved}


@dataclass(frozen=True)
class Shaped(FmuParameters):
    """Parameters of the FMU, and an input of the FMU that says when they act."""

    spec: ShapedEffect

    @property
    def owns(self) -> frozenset[str]:
        """Its parameters and its shape's input."""
        return super().owns | {self.spec.input}

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """The inputs with the shape in place of its input."""
        if amplitude == 0:
            return inputs
        return {
            **inputs,
            self.spec.input: shape_signal(self.spec.shape, inputs, recording, self.output_names, self.means),
        }

    def _shapes(self) -> list[Shape]:
        return self.spec.shape


@dataclass(frozen=True)
class ChangedInput(DeclaredKind):
    """An input that is not what was recorded or scheduled."""

    spec: InputEffect

    @property
    def changes(self) -> frozenset[str]:
        """Its input."""
        return frozenset({self.spec.input})

    @property
    def moves_in_time(self) -> frozenset[str]:
        """Its input where the operation is a shift."""
        return self.changes if self.spec.operation == "shift" else frozenset()

    def invented(self, time: np.ndarray) -> np.ndarray:
        """What comes after an input that was moved to be earlier: all outputs follow it."""
        earliest = min(self.lower * self.spec.factor, self.upper * self.spec.factor)
        late = (time > time[-1] + earliest) & (self.spec.operation == "shift")
        return np.tile(late, (len(self.output_names), 1))

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """The inputs with the changed one in its place."""
        if amplitude == 0:
            return inputs
        old, size = inputs[self.spec.input], amplitude * self.spec.factor
        if self.spec.operation == "shift":
            new = Piecewise(old.times + size, old.values, old.kind)
        else:
            shape = shape_signal(self.spec.shape, inputs, recording, self.output_names, self.means)
            adds = self.spec.operation == "add"
            new = joined(old, shape, (lambda x, y: x + size * y) if adds else (lambda x, y: _gained(x, size * y)))
        return {**inputs, self.spec.input: new}

    def _shapes(self) -> list[Shape]:
        return self.spec.shape


def _gained(x: np.ndarray, share: np.ndarray) -> np.ndarray:
    """An input with a share of itself more, or less: no more can be taken of it than all."""
    return np.asarray(x * np.maximum(1.0 + share, 0.0))


@dataclass(frozen=True)
class Sensor(DeclaredKind):
    """A sensor that does not show what is there."""

    spec: SensorEffect

    @property
    def changes(self) -> frozenset[str]:
        """Its outputs, and the inputs that carry or follow its readings."""
        outputs = {f"output:{name}" for name in self.spec.outputs}
        return frozenset(outputs | {*self.spec.fed_back, *self.spec.replayed.values()})

    def obstacle(self, recording: Recording, *, replay: bool) -> str:
        """Why the effect cannot be tried on this recording: no channel of it was measured."""
        seen = [np.isfinite(recording.outputs[k]).any() for k in self._rows()]
        return super().obstacle(recording, replay=replay) or (
            "" if any(seen) else f"{', '.join(self.spec.outputs)} was not measured"
        )

    def inputs(self, amplitude: float, inputs: dict[str, Piecewise], recording: Recording) -> dict[str, Piecewise]:
        """Inputs that follow the sensor's reading: the controller's set point, and the actuator that is replayed."""
        size = amplitude * self.spec.factor
        if size == 0:
            return inputs
        changed = {}
        for name in self.spec.fed_back:
            changed[name] = Piecewise(inputs[name].times, inputs[name].values - size, inputs[name].kind)
        for name in self.spec.replayed.values():
            read = inputs[name]
            match self.spec.operation:
                case "bias":
                    changed[name] = Piecewise(read.times, read.values - size, read.kind)
                case "gain":
                    true = (read.values + size * self.spec.about) / (1.0 + size)
                    changed[name] = Piecewise(read.times, true, read.kind)
                case "shift":
                    changed[name] = Piecewise(read.times + size, read.values, read.kind)
        return {**inputs, **changed}

    def invented(self, time: np.ndarray) -> np.ndarray:
        """What a clock that is late shows at the end, and one that is early at the start."""
        found = super().invented(time)
        if self.spec.operation == "shift":
            ends = sorted((self.lower * self.spec.factor, self.upper * self.spec.factor))
            found[self._rows()] = (time + ends[0] < time[0]) | (time + ends[1] > time[-1])
        return found

    def outputs(self, amplitude: float, outputs: np.ndarray, time: np.ndarray) -> np.ndarray:
        """What the sensors show, shape (outputs, steps) [unit of each output]."""
        size = amplitude * self.spec.factor
        if size == 0:
            return outputs
        shown, rows = np.array(outputs, dtype=float), self._rows()
        for k in rows:
            shown[k] = self._reading(size, shown[k], time)
        return shown

    def _reading(self, size: float, y: np.ndarray, time: np.ndarray) -> np.ndarray:
        match self.spec.operation:
            case "bias":
                return y + size
            case "gain":
                return y + size * (y - self.spec.about)
            case "drift":
                return y + size * (time - time[0]) / (30 * DAY)
            case "shift":
                return np.interp(time + size, time, y)
            case "lag":
                return lagged(y, size, float(time[1] - time[0]))

    def _rows(self) -> list[int]:
        return [self.output_names.index(name) for name in self.spec.outputs]


def lagged(y: np.ndarray, constant: float, step: float) -> np.ndarray:
    """First-order lag of samples ``y`` (steps,) at ``step`` [s] with a time constant [s] > 0, at rest at the start.

    Exact for a signal of straight lines between the samples (first-order hold): over one step
    z1 = a z0 + (b - a) y0 + (1 - b) y1 with a = exp(-step / constant), b = (1 - a) constant / step.
    """
    from scipy.signal import lfilter  # it brings scipy.stats, which takes a second

    a = np.exp(-step / constant)
    b = (1.0 - a) * constant / step
    shown, _ = lfilter([1.0 - b, b - a], [1.0, -a], y - y[0], zi=np.zeros(1))
    return np.asarray(shown + y[0])
