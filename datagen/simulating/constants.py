"""Uncertain constants: their values in the FMU, and what a simulated system has in their place.

A building's constants are not as declared, so an estimator that shall read measurements has to have seen systems whose
constants differ as much as the description says they may. Told of the declared ones alone, it takes what a heavier
floor does for something that the parameters do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from datagen.driving.sampling import stream
from datagen.fmi.fmu import Fmu
from shared.system import System


@dataclass(frozen=True)
class Constant:
    """An uncertain constant: FMU parameters by name [unit of each], all multiplied by exp(``relative`` * N(0, 1))."""

    name: str
    relative: float
    parameters: dict[str, float]


def constants(system: System, fmu: Fmu) -> tuple[Constant, ...]:
    """The uncertain constants of a description that fits its FMU, with the values that they have."""
    return tuple(
        Constant(
            one.name,
            one.relative,
            {name: float(system.fixed.get(name, fmu.variables[name].start)) for name in one.parameters},
        )
        for one in system.uncertain
    )


def sample_factors(system: System, root_seed: int, index: int) -> np.ndarray:
    """Draw by what a system's uncertain constants are multiplied [1], shape (constants,), as described in order."""
    normal = stream(root_seed, index, "constants").standard_normal(len(system.uncertain))
    return np.exp(np.array([one.relative for one in system.uncertain]) * normal)


def values_of(constants: tuple[Constant, ...], factors: np.ndarray) -> dict[str, float]:
    """FMU parameters [unit of each] of constants that are multiplied by some factors, shape (constants,)."""
    return {
        name: value * float(factor)
        for one, factor in zip(constants, factors, strict=True)
        for name, value in one.parameters.items()
    }
