"""How numbers and counts are written for people."""

from __future__ import annotations

GREAT = 1e6
"""From here on numbers are written with powers of ten."""


def number(value: float | None, digits: int = 4, *, signed: bool = False) -> str:
    """A number to so many significant digits, without powers of ten where people can do without; a dash for none.

    Zero has no sign; ``signed`` writes the plus of a positive number, too.
    """
    if value is None:
        return "–"
    text = f"{value:{'+' if signed else ''}.{digits}g}"
    if float(text) == 0:
        return "0"
    if "e+" in text and abs(value) < GREAT:
        return f"{float(text):{'+' if signed else ''}.0f}"
    return text


def counted(count: int, noun: str, plural: str | None = None) -> str:
    """A count with its noun: "1 system", "2 systems"; ``plural`` where it is not the noun with an s."""
    return f"{count} {noun if count == 1 else plural or f'{noun}s'}"


def chance(value: float) -> str:
    """A probability: what some hundred recordings have told is never certain.

    >>> chance(0.93), chance(0.9999)
    ('93%', 'over 99%')
    """
    return "over 99%" if value > 0.99 else "under 1%" if value < 0.01 else f"{value:.0%}"
