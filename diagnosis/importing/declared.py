"""What readings look like beside what the system description declares: sentences for those who know the building."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.importing import units
from diagnosis.importing.quality import is_constant
from diagnosis.importing.series import Series
from shared.system import System
from shared.units import TEMPERATURES, spelled
from shared.variables import (
    ZERO_CELSIUS,
    ConstantInput,
    ExcitationInput,
    MeasuredInput,
    Output,
    ScheduleInput,
    WeatherInput,
)

LARGE, BEYOND_NOISE = 10.0, 100.0
"""So many times the largest number that the description has in this unit, and its sensor's noise, is no such thing."""
HOT = 311.15
"""The air outdoors is hardly anywhere above this half of the time [K], but a winter's degrees Fahrenheit are."""
HOTTEST = 323.15
"""The air outdoors is above this [K] in a few deserts only; the highest ever recorded on earth is 56.7 degC (Death
Valley, 10 July 1913; World Meteorological Organization)."""
WIDEST = 30.0
"""The air outdoors hardly ever moves by more within a day [K], and degrees Fahrenheit taken for Celsius do."""
COLDER = 3.0
"""Nothing indoors is colder than the air outdoors by so much on average [K], and varies more."""


def about_all(series: Sequence[Series], system: System) -> list[str]:
    """All that is to be said of a recording's variables beside their description."""
    outputs = {one.name: one for one in system.outputs}
    said = []
    for one in series:
        output = outputs.get(one.target.name)
        said += [about_spread(output, one) if output is not None else None, about_size(one, system)]
    air = [one for one in series if one.target.name in _air(system) and one.signal is not None]
    said += [about_heat(one) for one in air]
    return [*(sentence for sentence in said if sentence), *about_swap(series, air)]


def about_spread(one: Output, series: Series) -> str | None:
    """A sentence if the readings of an output move by less than its sensor's noise, as those in too large a unit do."""
    noise = max((sensor.sd for sensor in one.noise.values()), default=0.0)
    if series.signal is None or is_constant(series.signal):
        return None
    values = series.signal.clean().values
    spread = float(np.ptp(values))
    if spread >= noise:
        return None
    return (
        f"{one.name}: {series.origin} varies by {spread:.3g} {one.unit} in all, from {values.min():.6g} to"
        f" {values.max():.6g}, which is less than its sensor's noise (standard deviation {noise:g} {one.unit}); is the"
        " unit right?"
    )


def about_size(series: Series, system: System) -> str | None:
    """A sentence if a quantity without limits is far larger than all that the description has in its unit.

    Numbers without a unit are of many kinds, and are not compared.
    """
    unit, signal = series.target.unit, series.signal
    if signal is None or unit == "1" or np.isfinite(units.limits("", unit, sun=series.target.sun)[1]):
        return None
    sizes = np.abs(signal.clean().values)
    largest, field = _largest(system, unit)
    if largest <= 0 or not (sizes > 0).any():
        return None
    usual = float(np.median(sizes[sizes > 0]))
    noise = max((sensor.sd for one in system.outputs if one.unit == unit for sensor in one.noise.values()), default=0.0)
    if usual <= max(LARGE * largest, BEYOND_NOISE * noise):
        return None
    return (
        f"{series.target.name}: {series.origin} is usually {usual:.4g} {unit} where it is not 0, and the largest number"
        f" in {unit} that the description has is {largest:.4g} ({field}); is the unit right?"
    )


def about_heat(air: Series) -> str | None:
    """A sentence if the air outdoors [K] is hotter than it is anywhere, or moves by more within a day."""
    if air.signal is None:
        return None
    clean = air.signal.clean()
    middle, most = float(np.median(clean.values)), float(clean.values.max())
    _, day = np.unique(np.floor(clean.middle / 86400.0), return_inverse=True)
    low, high = np.full(day.max() + 1, np.inf), np.full(day.max() + 1, -np.inf)
    np.minimum.at(low, day, clean.values)
    np.maximum.at(high, day, clean.values)
    swing = float((high - low).max())
    if middle > HOT:
        found = f"has a median of {middle - ZERO_CELSIUS:.1f} degC"
    elif most > HOTTEST:
        found = f"reaches {most - ZERO_CELSIUS:.1f} degC (the highest ever recorded on earth is 56.7 degC)"
    elif swing > WIDEST:
        found = f"moves by {swing:.1f} K within a day"
    else:
        return None
    return f"{air.target.name}: {air.origin}, the air outdoors, {found}; is the unit right (degF?)"


def about_swap(series: Sequence[Series], air: Sequence[Series]) -> list[str]:
    """Sentences on temperatures that are colder than the air outdoors and vary more: columns may be swapped."""
    said = []
    for out in air:
        for one in [one for one in series if one.target.role == "output" and spelled(one.target.unit) in TEMPERATURES]:
            warmth = units.convert(one.values, spelled(one.target.unit), "K", density=1.0, where=one.target.name)
            both = np.isfinite(out.values) & np.isfinite(warmth)
            if both.sum() < 2:
                continue
            inside, outside = warmth[both], out.values[both]
            colder = float(np.mean(outside - inside))
            if colder > COLDER and inside.std() > outside.std():
                said.append(
                    f"{one.target.name}: {one.origin} is {colder:.1f} K colder on average than {out.target.name},"
                    f" {out.origin}, the air outdoors, and varies more; are their columns swapped?"
                )
    return said


def _air(system: System) -> set[str]:
    """Inputs that are the temperature of the air outdoors, by pvlib's name of it, in K."""
    weather = [one for one in system.inputs if isinstance(one, WeatherInput)]
    return {one.name for one in weather if one.column == "temp_air" and spelled(one.unit) == "K"}


def _largest(system: System, unit: str) -> tuple[float, str]:
    """The largest number that a description has in a unit, and its field; 0 if it has none."""
    found = [(one.max, f"max of parameter {one.name}") for one in system.parameters if one.unit == unit]
    found += [(abs(one.upper), f"upper of effect {one.name}") for one in system.effects if one.unit == unit]
    for one in system.inputs:
        if one.unit != unit:
            continue
        if isinstance(one, ConstantInput | MeasuredInput):
            found.append((abs(one.value), f"value of input {one.name}"))
        elif isinstance(one, ScheduleInput):
            hours = system.schedules[one.schedule]
            rows = [*hours.weekday, *(hours.weekend or [])]
            found += [(abs(value), f"schedules.{one.schedule}") for _, value in rows]
        elif isinstance(one, ExcitationInput):
            parts = system.excitations[one.excitation].components
            found += [(abs(part.amplitude), f"excitations.{one.excitation}") for part in parts]
    return max((one for one in found if np.isfinite(one[0])), default=(0.0, ""))
