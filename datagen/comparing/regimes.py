"""Which regime a system is in, step by step, from its description alone: no variable is known by its name here.

- an **actuator** is an output that a measured input may replace (its ``column``): at its lowest, in between, at its
  highest, without the excitation that is added to it. A heater at its highest is saturated if it dwells there;
- **occupied** is when an input of source ``occupancy`` is above zero;
- **sun** is when a weather input that is an irradiance is above 50 W/m2.
"""

from __future__ import annotations

import calendar

import numpy as np

from datagen.driving.tables import InputTable
from shared.schema import EPOCH
from shared.system import System
from shared.variables import ExcitationInput, MeasuredInput, OccupancyInput, WeatherInput

SUN = 50.0
"""Irradiance from which on a step counts as sunny [W/m2]."""
END = 0.005
"""Share of an actuator's span that counts as its lowest or highest value."""
_IRRADIANCES = ("poa_global", "ghi", "dni", "dhi")


def regimes(system: System, table: InputTable, edges: np.ndarray, outputs: np.ndarray) -> dict[str, np.ndarray]:
    """Masks (steps,) by regime of the steps whose ends, and the first beginning, are ``edges`` [s].

    ``table`` has the inputs that acted; ``outputs`` are all of the description, (outputs, steps) [unit of each].
    """
    means = dict(zip(table.names, table.means(edges).T, strict=True))
    found: dict[str, np.ndarray] = {}
    for one in system.inputs:
        if isinstance(one, OccupancyInput):
            found[f"{one.name}: occupied"] = means[one.name] > 0
            found[f"{one.name}: empty"] = means[one.name] <= 0
        elif isinstance(one, WeatherInput) and one.column in _IRRADIANCES:
            found[f"{one.name}: sun"] = means[one.name] > SUN
            found[f"{one.name}: no sun"] = means[one.name] <= SUN
    actuators = [one.column for one in system.inputs if isinstance(one, MeasuredInput)]
    at_ends = dict(zip(table.names, table.at(edges[1:]).T, strict=True))
    for output, values in zip(system.outputs, outputs, strict=True):
        if output.name not in actuators:
            continue
        acted = means if output.method == "mean" else at_ends
        excited = [acted[i.name] for i in system.inputs if isinstance(i, ExcitationInput) and i.unit == output.unit]
        found |= _positions(output.name, values - sum(excited, np.zeros_like(values)), output.accuracy)
    return found


def _positions(name: str, values: np.ndarray, accuracy: float) -> dict[str, np.ndarray]:
    low, high = float(values.min()), float(values.max())
    margin = max(END * (high - low), accuracy)
    lowest = values <= low + margin
    highest = (values >= high - margin) & ~lowest  # one that never moves is at its lowest all the time
    return {
        f"{name}: at its lowest": lowest,
        f"{name}: in between": ~(lowest | highest),
        f"{name}: at its highest": highest,
    }


def months(time: np.ndarray) -> dict[str, np.ndarray]:
    """Masks by calendar month of the step's end, shape of ``time`` [s since time zero] each."""
    moment = np.datetime64(EPOCH.replace(" ", "T"), "s") + np.round(np.asarray(time) - 1).astype("timedelta64[s]")
    month = moment.astype("datetime64[M]").astype(int) % 12
    names = list(calendar.month_name)[1:]
    return {name: month == k for k, name in enumerate(names)}
