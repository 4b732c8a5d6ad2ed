"""Given facts of one system: the draw, and the FMU parameters and weather settings that follow from it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from datagen.driving.sampling import sample_parameters, stream
from shared.system import System


def sample_given(system: System, root_seed: int, index: int) -> dict[str, float]:
    """Draw the given facts of a system, by name [unit of each]; each has a stream of its own.

    Examples
    --------
    >>> from shared.system import load_system
    >>> sample_given(load_system("MixedAirCO2"), 0, 0)
    {}
    """
    if not system.given:
        return {}
    parameters = dict(zip(system.parameter_names, sample_parameters(system, root_seed, index), strict=True))
    found = {}
    for one in system.given:
        number = one.from_unit(float(stream(root_seed, index, f"given {one.name}").random()))
        found[one.name] = number * float(parameters[one.per]) if one.per else number
    return found


def fmu_values(system: System, given: Mapping[str, float], starts: Mapping[str, float]) -> dict[str, float]:
    """FMU parameters [unit of each] that given facts set.

    Parameters
    ----------
    given
        Values by name of the fact.
    starts
        The FMU's own values by name, which facts that are sums scale in proportion.
    """
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
