"""From unknowns and a nuisance to a simulation: its parameters and its inputs.

Effects see the inputs that drive the model. Persons whom nobody counted are pulses of the nuisance, so an effect that
follows or changes them is asked anew in each run, with that run's pulses and level in the signal.

The unknowns of a problem: standard normal numbers, and the values that they stand for.

Uncertain constants are among them because a model is right to no better than what it takes for granted. The layers of
a floor, known to a third, put parameters off by one to two posterior standard deviations if they are held; as unknowns
they cost the parameters a fifth of their certainty.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from hashlib import blake2b
from typing import TypeVar

import numpy as np
from scipy.special import ndtr, ndtri

from datagen.driving.tables import InputTable, Piecewise, merge
from datagen.simulating.constants import Constant
from diagnosis.effects.base import Effect
from diagnosis.effects.library import inputs_of, parameters_of
from diagnosis.fitting.inputs import Drive
from diagnosis.fitting.nuisance import Level, Nuisance
from diagnosis.fitting.simulations import Run
from diagnosis.recording import Recording
from shared.system import System

LIMIT = 3.7
"""Bound of a parameter's unknown: the outer 0.01 % of its range are not told apart from its ends."""

EDGE = 0.01
"""A parameter this close to an end of its range, as a share of the range, lies on its bound."""


def within_limit(factor: float, relative: float | None) -> float:
    """An end of a factor's interval as it is shown: no further than a fit takes the constant.

    ``relative`` is the prior standard deviation of its logarithm; what has none stays as it is.
    """
    if relative is None:
        return factor
    return float(np.clip(factor, np.exp(-LIMIT * relative), np.exp(LIMIT * relative)))


@dataclass(frozen=True)
class Unknowns:
    """Parameters by the probit of their place in their range, amplitudes in units of their scales, constants, levels.

    So bounds hold, and the uniform prior in a parameter's scale is N(0, 1) exactly.
    """

    system: System
    effects: tuple[Effect, ...]
    constants: tuple[Constant, ...]
    levels: tuple[Level, ...]

    @property
    def names(self) -> list[str]:
        """Names: parameters, effects, uncertain constants, levels of the nuisance."""
        levels = [f"level of {self.system.input_names[one.column]}" for one in self.levels]
        effects = [one.name for one in self.effects]
        return [*self.system.parameter_names, *effects, *(one.name for one in self.constants), *levels]

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.system.parameters) + len(self.effects) + len(self.constants) + len(self.levels)

    @property
    def places_of_constants(self) -> range:
        """Where the constants are among the unknowns."""
        first = len(self.system.parameters) + len(self.effects)
        return range(first, first + len(self.constants))

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds, each (unknowns,)."""
        count = len(self.system.parameters)
        low = [-LIMIT] * count + [one.lower / one.scale for one in self.effects]
        high = [LIMIT] * count + [one.upper / one.scale for one in self.effects]
        last = [LIMIT] * (len(self.constants) + len(self.levels))
        return np.array([*low, *(-x for x in last)], dtype=float), np.array([*high, *last], dtype=float)

    def values(self, z: np.ndarray) -> np.ndarray:
        """Parameters, amplitudes, factors of constants, and levels, shape (..., unknowns) [unit of each]."""
        z = np.asarray(z, dtype=float)
        made = np.empty_like(z)
        for k, one in enumerate(self.system.parameters):
            made[..., k] = one.from_unit(ndtr(z[..., k]))
        for k, effect in enumerate(self.effects, len(self.system.parameters)):
            made[..., k] = effect.scale * z[..., k]
        for k, constant in enumerate(self.constants, len(self.system.parameters) + len(self.effects)):
            made[..., k] = np.exp(constant.relative * z[..., k])
        for k, level in enumerate(self.levels, self.size - len(self.levels)):
            made[..., k] = level.low + (level.high - level.low) * ndtr(z[..., k])
        return made

    def of(self, values: Mapping[str, float]) -> np.ndarray:
        """The unknowns of given values by name; zero (middle of the prior, no effect) for others.

        Of constants the factors. Shape (unknowns,).
        """
        z = np.zeros(self.size)
        for k, one in enumerate(self.system.parameters):
            if one.name in values:
                low, high, value = one.min, one.max, float(values[one.name])
                if one.scale == "log":
                    low, high, value = np.log(low), np.log(high), np.log(max(value, 1e-300))
                z[k] = np.clip(ndtri(np.clip((value - low) / (high - low), 0, 1)), -LIMIT, LIMIT)
        for k, effect in enumerate(self.effects, len(self.system.parameters)):
            z[k] = values.get(effect.name, 0.0) / effect.scale
        for k, constant in zip(self.places_of_constants, self.constants, strict=True):
            z[k] = np.clip(np.log(values.get(constant.name, 1.0)) / constant.relative, -LIMIT, LIMIT)
        return z

    def parameters(self, z: np.ndarray) -> dict[str, float]:
        """What the model is given: parameters, constants, and what effects set, by name [unit of each]."""
        values = self.values(z).tolist()
        made = dict(zip(self.system.parameter_names, values, strict=False))
        for constant, factor in zip(self.constants, values[len(made) + len(self.effects) :], strict=False):
            made |= {name: factor * value for name, value in constant.parameters.items()}
        for effect, amplitude in zip(self.effects, self.amplitudes(z), strict=True):
            made |= parameters_of(effect, amplitude)
        return made

    def amplitudes(self, z: np.ndarray) -> tuple[float, ...]:
        """Amplitudes of the effects [unit of each]."""
        first = len(self.system.parameters)
        return tuple(float(one.scale * x) for one, x in zip(self.effects, z[first:], strict=False))

    def level_values(self, z: np.ndarray) -> np.ndarray:
        """What each level multiplies by, shape (levels,)."""
        return self.values(z)[self.size - len(self.levels) :]

    def at_bound(self, z: np.ndarray) -> tuple[str, ...]:
        """Names of unknowns that lie on their bounds."""
        count = len(self.system.parameters)
        low, high = self.bounds
        names = []
        for k, name in enumerate(self.names):
            if k < count:
                place = float(ndtr(z[k]))
                touches = place < EDGE or place > 1 - EDGE
            else:  # ranges of amplitudes may be infinite, and zero is no bound but the base model
                touches = any(bound != 0 and abs(z[k] - bound) < EDGE for bound in (low[k], high[k]))
            if touches:
                names.append(name)
        return tuple(names)


TABLES = 64
"""Inputs that are remembered at most, and so many changes of them: those that were asked for last."""

Signals = dict[str, Piecewise]
Key = TypeVar("Key")
Value = TypeVar("Value")


class Runs:
    """Makes simulations of one recording.

    Parameters
    ----------
    driven
        The inputs.
    stand_ins
        Signals in place of those of inputs that the nuisance describes.
    facts
        FMU parameters that given facts of the building set, by name [unit of each].
    """

    def __init__(
        self,
        driven: Drive,
        stand_ins: Signals,
        recording: Recording,
        facts: Mapping[str, float],
        *,
        replay: bool,
        tolerance: float,
    ) -> None:
        self._drive, self._recording, self._facts = driven, recording, facts
        # inputs in the order of the description
        self._signals = {name: {**driven.signals, **stand_ins}[name] for name in driven.signals}
        self._replay, self._tolerance = replay, tolerance
        self._tables: OrderedDict[tuple[bytes, ...], InputTable] = OrderedDict()
        self._changes: OrderedDict[tuple[object, ...], Signals] = OrderedDict()

    def run(self, unknown: Unknowns, nuisance: Nuisance, z: np.ndarray, heights: np.ndarray) -> Run:
        """The simulation for ``z`` (unknowns,) and nuisance ``heights`` (pulses,) before their level."""
        levels = unknown.level_values(z)
        persons: Signals = {}
        if any(unknown.amplitudes(z)) and nuisance.levels:
            driving = self._driving({}, nuisance, levels, heights)
            persons = {driving.names[one.column]: _held(driving, one.column) for one in nuisance.levels}
        changed = self._changed(unknown.effects, unknown.amplitudes(z), persons)
        return Run(
            {**self._facts, **unknown.parameters(z)},
            self._driving(changed, nuisance, levels, heights),
            start=self._drive.begin,
            stop=self._drive.stop,
            record_from=self._drive.start,
            replay=self._replay,
            tolerance=self._tolerance,
        )

    def _driving(self, changed: Signals, nuisance: Nuisance, levels: np.ndarray, heights: np.ndarray) -> InputTable:
        """All inputs with the nuisance: persons of a changed signal are in it already, and so is their level."""
        table = self._table(changed, nuisance)
        for level, factor in zip(nuisance.levels, levels, strict=True):
            done = table.names[level.column] in changed
            heights = np.where(nuisance.column == level.column, 0.0 if done else factor * heights, heights)
            scale = np.where(np.arange(len(table.names)) == level.column, 1.0 if done else factor, 1.0)
            table = replace(table, left=table.left * scale, right=table.right * scale)
        return nuisance.added(table, heights)

    def _changed(self, effects: tuple[Effect, ...], amplitudes: tuple[float, ...], persons: Signals) -> Signals:
        """The inputs that effects change, of those that they see: with the persons of this run."""
        key = (tuple(one.name for one in effects), amplitudes, _digest(persons))
        if key not in self._changes:
            seen = {**self._signals, **persons}
            signals = seen
            for effect, amplitude in zip(effects, amplitudes, strict=True):
                signals = inputs_of(effect, amplitude, signals, self._recording)
            self._changes[key] = {name: signals[name] for name in seen if signals[name] is not seen[name]}
        return _latest(self._changes, key)

    def _table(self, changed: Signals, nuisance: Nuisance) -> InputTable:
        """All inputs but for the nuisance, with knots where its pulses begin and end."""
        key = (_digest(changed), nuisance.edges.tobytes())
        if key not in self._tables:
            signals = {**self._signals, **changed}
            self._tables[key] = merge(signals, self._drive.begin, self._drive.stop).refined(nuisance.edges)
        return _latest(self._tables, key)


def _held(table: InputTable, column: int) -> Piecewise:
    """An input of a table that holds its values between knots, as a signal."""
    values = table.left[:, column]
    first = np.append(True, values[1:] != values[:-1])
    return Piecewise(table.time[:-1][first], values[first], "previous")


def _digest(signals: Signals) -> bytes:
    """What tells signals from others."""
    digest = blake2b(digest_size=16)
    for name, signal in signals.items():
        digest.update(repr((name, signal.kind, len(signal.times))).encode())
        digest.update(signal.times.tobytes() + signal.values.tobytes())
    return digest.digest()


def _latest(known: OrderedDict[Key, Value], key: Key) -> Value:
    """A value that is known, which is the last to be forgotten from now on."""
    known.move_to_end(key)
    if len(known) > TABLES:
        known.popitem(last=False)
    return known[key]
