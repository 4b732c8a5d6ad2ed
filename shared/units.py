"""One spelling for units that are written in several ways, and which temperatures are differences."""

from __future__ import annotations

SPELLINGS = {
    "W/m^2": "W/m2",
    "W.m-2": "W/m2",
    "W m-2": "W/m2",
    "W/m²": "W/m2",
    "m.s-1": "m/s",
    "m s-1": "m/s",
    "kg.s-1": "kg/s",
    "kg s-1": "kg/s",
    "°C": "degC",
    "Celsius": "degC",
    "celsius": "degC",
    "C": "degC",
    "°F": "degF",
    "kelvin": "K",
}
"""How units are written, by the spelling that limits and checks go by."""
TEMPERATURES = ("K", "degC", "degF")
"""Units of temperature, each in its one spelling."""
ABSOLUTE = 150.0
"""Temperatures in buildings are above [K], and differences of temperature below."""


def spelled(unit: str) -> str:
    """A unit in the one spelling that limits and checks go by; as it is if it has no other."""
    return SPELLINGS.get(unit.strip(), unit.strip())
