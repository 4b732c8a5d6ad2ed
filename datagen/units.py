"""What a number in one unit becomes in another: of a description beside its FMU, of weather. pint knows the units."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from shared.units import spelled

UNITLESS = {"", "1", "-"}
"""How a pure number's unit is written."""
_WORDS = {**dict.fromkeys(UNITLESS, "1"), "%": "percent", "deg": "degree", "degree": "degree"}


@dataclass(frozen=True)
class Conversion:
    """From one unit to another, as of a description to its FMU's: ``factor * value + offset``.

    Examples
    --------
    >>> conversion("degC", "K").to_fmu(20.0)
    293.15
    >>> conversion("kW", "W").from_fmu(1500.0)
    1.5
    """

    factor: float = 1.0
    offset: float = 0.0

    @property
    def nothing(self) -> bool:
        """Whether both units are one."""
        return self.factor == 1.0 and self.offset == 0.0

    def to_fmu(self, values: Any) -> Any:
        """Numbers of the description in the FMU's unit, same shape."""
        return self.factor * values + self.offset

    def from_fmu(self, values: Any) -> Any:
        """Numbers of the FMU in the description's unit, same shape."""
        return (values - self.offset) / self.factor


@lru_cache(maxsize=1)
def registry() -> Any:
    """The units: of one registry, for those of two do not mix."""
    import pint

    return pint.UnitRegistry(cache_folder=None)


@lru_cache(maxsize=512)
def parsed(unit: str) -> Any:
    """A unit in the spelling of the FMI or of CF, such as ``W/(m2.K)`` or ``W m-2``, as one of pint's.

    Raises ValueError if pint does not know it.
    """
    text = _WORDS.get(unit.strip(), spelled(unit))
    if text == "1":
        return registry().dimensionless
    text = text.replace("²", "2").replace("³", "3").replace("°", "deg").replace("·", ".")
    text = re.sub(r"(?<=[A-Za-z0-9)])\.(?=[A-Za-z(])", "*", text)
    text = re.sub(r"([A-Za-z])(-?\d+)", r"\1**\2", text)
    try:
        return registry().parse_units(text)
    except Exception:  # its parser raises whatever Python's tokenizer meets
        raise ValueError(f"unit {unit!r} is not known") from None


def conversion(declared: str, fmu: str, *, difference: bool = False) -> Conversion | None:
    """What numbers in the unit ``declared`` become in the unit ``fmu``; None if the two measure different things.

    Temperatures that are a ``difference``: 20 K are 20 degC of them. Raises ValueError if the units are spelled
    differently and one of them is not known.
    """
    if _WORDS.get(declared, spelled(declared)) == _WORDS.get(fmu, spelled(fmu)):
        return Conversion()
    source, goal = parsed(declared), parsed(fmu)
    if source.dimensionality != goal.dimensionality:
        return None
    ends = np.asarray(registry().Quantity(np.array([0.0, 1.0]), source).to(goal).magnitude, dtype=float)
    # differences of ends near 273 carry their rounding; factors of units have few digits
    factor = float(f"{ends[1] - ends[0]:.12g}")
    return Conversion(factor, 0.0 if difference else float(ends[0]))
