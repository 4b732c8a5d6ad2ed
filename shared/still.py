"""Readings that stand still: how long what moves may show one value before its sensor is taken for stuck.

Columns of measurements and of weather files are held to the same rules.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

STUCK_AFTER = 12.0
"""How long a sensor of what moves may show one value [h]: half of the day's cycle."""
CALM = 120.0
"""How long wind may be exactly zero [h]: a cup anemometer does not turn below about half a metre per second, and a
winter's high stays over a valley for days; one that nothing has stirred for five days is frozen or dead."""
DARK = 10.0
"""Irradiance [W/m2] that may stand still all night."""


@dataclass(frozen=True)
class Resting:
    """Readings of at most ``size`` [unit of the readings] are believed for ``hours`` [h] in a row."""

    size: float
    hours: float


RESTING = {"W/m2": Resting(DARK, np.inf), "m/s": Resting(0.0, CALM)}
"""What may stand still for longer, by unit: the sun as long as it likes, as a polar night does, and wind in a calm."""


@dataclass(frozen=True, eq=False)
class Runs:
    """Runs of equal readings, shape (runs,) each: number of the first and of the last reading, and the length [h]."""

    first: np.ndarray
    last: np.ndarray
    hours: np.ndarray


def elapsed(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """From beginnings to ends [s]."""
    return end - begin


def long_runs(
    values: np.ndarray,
    begin: np.ndarray,
    end: np.ndarray,
    hours: float,
    resting: Resting | None,
    joined: np.ndarray,
    lasting: Callable[[np.ndarray, np.ndarray], np.ndarray] = elapsed,
) -> Runs:
    """Runs of equal readings (n,) that last longer than ``hours`` [h]; of ``resting`` ones, as it says.

    ``begin`` and ``end`` [s] are the intervals of the readings, in order; a run goes on from one to the next where they
    are ``joined``, (n - 1,): not over a gap. ``lasting`` is how long something lasts [s] from its begin to its end [s],
    of what does not always move: irradiance by day.
    """
    runs = np.concatenate([[0], np.cumsum(~((np.diff(values) == 0) & joined))])
    numbers = np.arange(runs[-1] + 1)
    first = np.searchsorted(runs, numbers, side="left")
    last = np.searchsorted(runs, numbers, side="right") - 1
    believed = np.full(len(first), hours)
    if resting is not None:
        believed[np.abs(values[first]) <= resting.size] = resting.hours
    length = lasting(begin[first], end[last]) / 3600.0
    long = length > believed
    return Runs(first[long], last[long], length[long])
