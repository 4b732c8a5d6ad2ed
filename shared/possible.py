"""Possible values of quantities that buildings and their weather have, by unit; and numbers written in another unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shared.signals import Schedule
from shared.units import spelled
from shared.variables import ConstantInput, Input, ScheduleInput

POSSIBLE: dict[str, tuple[float, float]] = {
    "K": (223.15, 333.15),
    "degC": (-50.0, 60.0),
    "degF": (-58.0, 140.0),
    "ppm": (200.0, 10000.0),  # half of what the air has: a sensor without its baseline reads a hundred too low
    "W/m2": (-20.0, 1500.0),
    "m/s": (-0.1, 75.0),
    "kg/s": (-1e-3, np.inf),
}
"""Lowest and highest, in that unit: of absolute temperatures, where it is one of temperature."""
DIFFERENCE = 10.0
"""Differences of temperature that somebody sets, as of a setback, are hardly larger [K]; temperatures of rooms are."""
_OTHERS: dict[str, tuple[tuple[str, float, float], ...]] = {
    "K": (("degC", 1.0, 273.15), ("degF", 5 / 9, 273.15 - 32 * 5 / 9)),
    "degC": (("K", 1.0, -273.15),),
    "ppm": (("a fraction", 1e6, 0.0), ("percent", 1e4, 0.0)),
}
"""Units that are taken for another one, with the factor and the offset that lead to it."""


def in_another_unit(values: Sequence[float], unit: str) -> str:
    """What is wrong with numbers of a description that are in another unit than it says; empty if nothing shows.

    ``values`` [unit] stand for one quantity, as both ends of a range do. All of them must be impossible in ``unit`` and
    possible in another: hot water of 345 K is no slip. A small number of kelvins may be a difference.
    """
    unit = spelled(unit)
    if unit not in _OTHERS or not values:
        return ""
    low, high = POSSIBLE[unit]
    if any(low <= one <= high or (unit == "K" and abs(one) <= DIFFERENCE) for one in values):
        return ""
    meant = [
        name for name, factor, offset in _OTHERS[unit] if all(low <= factor * one + offset <= high for one in values)
    ]
    if not meant:
        return ""
    found = " to ".join(f"{one:g}" for one in values)
    return f"is {found} {unit}; expected {low:g} to {high:g} {unit}; is it in {' or '.join(meant)}?"


def driven_in_another_unit(inputs: Sequence[Input], schedules: Mapping[str, Schedule]) -> str:
    """What is wrong with the first constant or schedule that drives an input in another unit; empty if none does."""
    for one in inputs:
        if isinstance(one, ConstantInput) and (wrong := in_another_unit([one.value], one.unit)):
            return f"inputs {one.name!r}: value {wrong}"
        if not isinstance(one, ScheduleInput):
            continue
        for day in ("weekday", "weekend"):
            for hour, value in getattr(schedules[one.schedule], day) or []:
                if wrong := in_another_unit([value], one.unit):
                    where = f"schedules.{one.schedule}: {day}, from hour {hour:g}"
                    return f"{where}, of input {one.name!r}: {wrong}"
    return ""
