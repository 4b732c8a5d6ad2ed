"""NAME=VALUE on a command line."""

from __future__ import annotations

import math
from collections.abc import Iterable

from shared.errors import SystemDescriptionError


def assignments(items: Iterable[str], option: str = "set") -> dict[str, float]:
    """Parse ``NAME=VALUE`` with a number as value; ``option`` is where they were given.

    Raises SystemDescriptionError naming every item that is something else, or sets a name anew.
    """
    values: dict[str, float] = {}
    wrong = []
    for item in items:
        name, equals, text = (part.strip() for part in item.partition("="))
        value = _number(text)
        if not (name and equals and value is not None):
            wrong.append(f"--{option} {item!r}: expected NAME=VALUE with a finite number, like volume=150")
        elif name in values:
            wrong.append(f"--{option} {item!r}: {name!r} is given twice; expected one value of it")
        else:
            values[name] = value
    if wrong:
        raise SystemDescriptionError("\n".join(wrong))
    return values


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
