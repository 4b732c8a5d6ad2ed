"""The unknowns of a problem: standard normal numbers, and the values that they stand for.

Uncertain constants are among them because a model is right to no better than what it takes for granted. The layers of
a floor, known to a third, put parameters off by one to two posterior standard deviations if they are held; as unknowns
they cost the parameters a fifth of their certainty (docs/measurements.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from datagen.simulating.constants import Constant
from diagnosis.effects.asked import parameters_of
from diagnosis.effects.base import Effect
from diagnosis.fitting.nuisance import Level
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
            made[..., k] = np.exp(level.mean + level.sd * z[..., k])
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
