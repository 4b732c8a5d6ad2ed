"""Where randomness comes from: one independent stream for each system and purpose; parameters and given facts.

A system's data depend on (root seed, system index) alone, never on which worker simulates it or after what.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping

import numpy as np

from shared.errors import SystemDescriptionError
from shared.system import System

DRAWS = 10000
"""How often parameters are drawn at most, until the ratios of a description hold."""


def stream(root_seed: int, index: int, name: str) -> np.random.Generator:
    """The random stream of one system for one purpose, its name: a new one does not move the streams of others.

    Raises ValueError if the dataset's seed or the system's index is negative.
    """
    if root_seed < 0 or index < 0:
        raise ValueError(f"root seed is {root_seed}, index {index}; expected numbers that are not negative")
    # Python's own hash differs between processes. The top bit keeps clear of the small keys that splits use.
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big") | 0x80000000
    return np.random.default_rng(np.random.SeedSequence(root_seed, spawn_key=(index, number)))


def record_start(system: System, root_seed: int, index: int) -> float:
    """Draw when a system's record begins [s since time zero]: a whole day within ``experiment.start``, uniformly.

    Whole days, so that every record begins at midnight; where no midnight lies within, its first hour.
    """
    first, last = system.experiment.start
    day, days = math.ceil(first / 24), math.floor(last / 24) - math.ceil(first / 24) + 1
    if days < 1:
        return first * 3600.0
    return 86400.0 * (day + int(stream(root_seed, index, "start").integers(days)))


def is_calm(root_seed: int, index: int, share: float) -> bool:
    """Whether a system is one of the share (0 to 1) that is simulated without excitation."""
    return bool(stream(root_seed, index, "calm").random() < share)


def sample_parameters(system: System, root_seed: int, index: int) -> np.ndarray:
    """Draw a system's parameters, (parameters,) in the order of the description [unit of each].

    They are independent, uniform in each one's scale between its bounds. Where the description has ratios, they are
    drawn again until all of these hold.
    """
    rng = stream(root_seed, index, "parameters")
    for _ in range(DRAWS):
        u = rng.random(len(system.parameters))
        values = [float(p.from_unit(x)) for p, x in zip(system.parameters, u, strict=True)]
        named = dict(zip(system.parameter_names, values, strict=True))
        if all(one.holds(named) for one in system.ratios):
            return np.array(values)
    wanted = ", ".join(f"{one.over} / {one.under} from {one.min:g} to {one.max:g}" for one in system.ratios)
    raise SystemDescriptionError(
        f"{system.path}: ratios: none of {DRAWS} draws of the parameters has {wanted};"
        " expected ranges that allow for it"
    )


def sample_given(system: System, root_seed: int, index: int) -> dict[str, float]:
    """Draw the given facts of a system, by name [unit of each]; each has a stream of its own."""
    if not system.given:
        return {}
    parameters = dict(zip(system.parameter_names, sample_parameters(system, root_seed, index), strict=True))
    found = {}
    for one in system.given:
        number = one.from_unit(float(stream(root_seed, index, f"given {one.name}").random()))
        found[one.name] = number * float(parameters[one.per]) if one.per else number
    return found


def fmu_values(system: System, given: Mapping[str, float], starts: Mapping[str, float]) -> dict[str, float]:
    """FMU parameters [unit of each] that given facts set; those that are sums scale the FMU's own ``starts``."""
    values: dict[str, float] = {}
    for one in system.given:
        if one.name in given and one.parameters:
            share = given[one.name] / sum(starts[name] for name in one.parameters) if one.of == "sum" else None
            values |= {name: given[one.name] if share is None else share * starts[name] for name in one.parameters}
    return values


def told_values(system: System, root_seed: int, index: int) -> np.ndarray:
    """The facts that an estimator may be told, shape (facts,), in the order of the description [unit of each]."""
    drawn = sample_given(system, root_seed, index)
    return np.array([drawn[one.name] for one in system.told])
