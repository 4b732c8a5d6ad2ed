"""Units of columns: what people write, turned into what the system description wants. pint knows the units."""

from __future__ import annotations

from difflib import get_close_matches
from functools import lru_cache
from typing import Any, Literal

import numpy as np

from datagen.units import parsed, registry
from shared.errors import RecordingError
from shared.possible import POSSIBLE
from shared.units import spelled

LARGEST = 1e30
"""No reading is beyond: what a logger writes for a missing one (3.4e38) is, and sums of squares are still numbers."""
_WORDS = {
    "": "1",
    "fraction": "1",
    "presence": "1",
    "bool": "1",
    "person": "1",
    "persons": "1",
    "count": "1",
    "counts": "1",
    "%": "percent",
    "°C": "degC",
    "Celsius": "degC",
    "celsius": "degC",
    "degree": "deg",
}
"""Words that are no units of physics, or that pint reads otherwise, by what they stand for."""
_CANDIDATES = ("degC", "K", "degF", "fraction", "percent", "ppm", "W/m2", "kW/m2", "m/s", "km/h", "m3/h", "kg/s")
_MORE = ("W", "kW", "MW", "l/s", "m3/s", "Pa", "hPa")
_OTHER_WORDS = {
    "people": "persons",
    "occupants": "persons",
    "heads": "persons",
    "occupied": "presence",
    "occupancy": "presence",
    "pct": "percent",
}
"""Words that are none of ours, by what they may mean."""
_TYPES_OF_FLOW = ("[length] ** 3 / [time]", "[mass] / [time]")


def _parsed(unit: str) -> Any:
    return parsed(_WORDS.get(unit.strip(), unit.strip()))


def convert(values: np.ndarray | float, unit: str, target: str, *, density: float, where: str) -> np.ndarray:
    """Values from one unit to another, same shape.

    By the ``density`` of air volume flows become mass flows and back [kg/m3]; ``where`` begins the sentence of what is
    raised: RecordingError if a unit is not known, or the two measure different things.
    """
    values = np.asarray(values, dtype=np.float64)
    if _WORDS.get(unit, unit) == _WORDS.get(target, target):
        return values.copy()
    pint = registry()
    both = []
    for one in (unit, target):
        try:
            both.append(_parsed(one))
        except ValueError:
            raise RecordingError(
                f"{where}: unit {one!r} is not known; expected for example 'degC', 'K', 'ppm', 'm3/h', 'percent', "
                f"'fraction', 'persons' or 'presence'{_like(one)}"
            ) from None
    source, goal = both
    kinds = [one.dimensionality for one in both]
    if kinds[0] != kinds[1] or unit == "C":
        flows = [pint.get_dimensionality(kind) for kind in _TYPES_OF_FLOW]
        if kinds == flows:
            return np.asarray(pint.convert(values, source, "m**3/s") * pint.convert(density, "kg/s", goal))
        if kinds == flows[::-1]:
            return np.asarray(pint.convert(pint.convert(values, source, "kg/s") / density, "m**3/s", goal))
        hint = "; 'C' is coulomb, write 'degC'" if unit == "C" else ""
        raise RecordingError(f"{where}: unit {unit!r} cannot become {target!r}; expected a unit of the same kind{hint}")
    return np.asarray(pint.convert(values, source, goal), dtype=np.float64)


def same(one: str, other: str) -> bool:
    """Whether two units are one, whichever way they are written.

    >>> same("%", "percent"), same("kW", "W")
    (True, False)
    """
    try:
        return bool(_parsed(one) == _parsed(other))
    except ValueError:  # whoever converts it says that it is not known
        return True


def _like(unit: str) -> str:
    """Which known unit an unknown one may be, whichever its capitals; empty if none is like it."""
    known = {one.lower(): one for one in (*_CANDIDATES, *(word for word in _WORDS if word), *_MORE)}
    known |= _OTHER_WORDS
    near = get_close_matches(unit.strip().lower()[:80], known, n=1)
    return f"; did you mean {known[near[0]]!r}?" if near else ""


def alternatives(value: float, target: str, low: float, high: float, *, density: float) -> list[str]:
    """Common units in which ``value`` lies between ``low`` and ``high`` [target]: what a column may really be in."""
    found = []
    for unit in _CANDIDATES:
        try:
            inside = low <= float(convert(value, unit, target, density=density, where="")) <= high
        except RecordingError:
            continue
        if inside:
            found.append(unit)
    return found


Below = Literal["impossible", "zero", "noise"]
"""What a reading below zero is: impossible, if beyond the lower limit; zero, the offset of pyranometers at night or the
rounding of anemometers; or noise, of flow meters, which means need as it is."""
_BELOW: dict[str, Below] = {"W/m2": "zero", "m/s": "zero", "kg/s": "noise"}
"""The same by the system's unit, where it is not impossible."""
WORD_LIMITS = {
    "presence": (0.0, 1.0),
    "bool": (0.0, 1.0),
    "fraction": (0.0, 1.0),
    "percent": (0.0, 1.0),
    "%": (0.0, 1.0),
}
"""Shares of one whole, whichever way they are written."""
COUNTS = ("person", "persons", "count", "counts")
"""Numbers of persons."""


_LIKE = {"[length] ** 3 / [time]": "kg/s", "[mass] / [time]": "kg/s", "[mass] / [time] ** 3": "W/m2"}
"""Units with limits that hold, converted, for every unit of the same kind."""


@lru_cache(maxsize=256)
def _like_kind(target: str) -> str:
    """The unit whose limits are those of ``target``, by its kind; ``target`` in one spelling if none is."""
    if spelled(target) in POSSIBLE:
        return spelled(target)
    try:
        kind = _parsed(target).dimensionality
    except ValueError:  # a description's unit need not be one that pint knows
        return spelled(target)
    kinds = {registry().get_dimensionality(one): unit for one, unit in _LIKE.items()}
    return next((unit for one, unit in kinds.items() if one == kind), spelled(target))


def is_power(unit: str) -> bool:
    """Whether a unit is one of power, as W and kW are."""
    try:
        return bool(_parsed(unit).dimensionality == _parsed("W").dimensionality)
    except ValueError:
        return False


def limits(unit: str, target: str, *, sun: bool = True, density: float = 1.2) -> tuple[float, float, Below]:
    """Lowest and highest possible value [target], and what readings below zero are.

    ``sun`` says that what is in W/m2 is irradiance: a heat flux or a net radiation goes either way. ``density`` is that
    of air [kg/m3], by which volume flows have the limits of mass flows.
    """
    like = _like_kind(target)
    if like == "W/m2" and not sun:
        return -np.inf, np.inf, "impossible"
    if target == "1" and unit in WORD_LIMITS:
        return *WORD_LIMITS[unit], "impossible"
    if target == "1" and unit in COUNTS:
        return 0.0, np.inf, "impossible"
    low, high = POSSIBLE.get(like, (-np.inf, np.inf))
    if like != spelled(target):
        low, high = (
            float(convert(end, like, target, density=density, where="")) if np.isfinite(end) else end
            for end in (low, high)
        )
    return low, high, _BELOW.get(like, "impossible")
