"""Differences of simulations that do without those which fail: one bad point must not cost a whole recording.

A derivative whose simulation fails on one side is taken from the other; where both fail, the direction is left at zero
by whoever asked, so that the prior alone decides it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from shared.errors import SimulationError

SimulateOne = Callable[[np.ndarray], np.ndarray]


def one_sided(
    simulate: SimulateOne, z: np.ndarray, k: int, bounds: tuple[np.ndarray, np.ndarray], step: float
) -> np.ndarray | None:
    """Derivative of the outputs by unknown ``k`` from whichever side can be simulated.

    Parameters
    ----------
    simulate
        Outputs (outputs, steps) for unknowns (unknowns,); raises SimulationError where it cannot.
    z
        Where, shape (unknowns,); it must be possible to simulate it.
    bounds
        Of the unknowns, each (unknowns,).
    step
        Width of the difference.

    Returns
    -------
    numpy.ndarray or None
        Shape (outputs, steps); None if neither side can be simulated.
    """
    here = simulate(z)
    low, high = bounds
    for side in (step, -step):
        there = z.copy()
        there[k] = min(max(z[k] + side, low[k]), high[k])
        if there[k] == z[k]:
            continue
        try:
            return np.asarray((simulate(there) - here) / (there[k] - z[k]))
        except SimulationError:
            continue
    return None


def either_way(
    simulate: Callable[[list[np.ndarray]], list[np.ndarray]], runs: Sequence[np.ndarray]
) -> list[tuple[float, np.ndarray | None]]:
    """Outputs of runs, each as it is (1) or, where that fails, with its sign turned (-1); None where both fail.

    Parameters
    ----------
    simulate
        Outputs of several runs; raises SimulationError if one of them fails.
    runs
        What is added to the base, each (pulses,).
    """
    try:
        return [(1.0, one) for one in simulate(list(runs))]
    except SimulationError:
        pass
    found: list[tuple[float, np.ndarray | None]] = []
    for run in runs:
        for sign in (1.0, -1.0):
            try:
                found.append((sign, simulate([sign * run])[0]))
                break
            except SimulationError:
                continue
        else:
            found.append((1.0, None))
    return found
