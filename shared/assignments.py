"""NAME=VALUE on a command line."""

from __future__ import annotations

import math
from collections.abc import Iterable

from shared.errors import SystemDescriptionError


def assignments(items: Iterable[str], option: str = "set") -> dict[str, float]:
    """Parse ``NAME=VALUE`` with a number as value; ``option`` is where they were given.

    Raises SystemDescriptionError naming the first item that is something else, or sets a name anew.
    """
    values: dict[str, float] = {}
    for item in items:
        name, equals, text = item.partition("=")
        try:
            if not equals:
                raise ValueError
            value = float(text)
            if not math.isfinite(value):
                raise ValueError
        except ValueError:
            sentence = f"--{option} {item!r}: expected NAME=VALUE with a finite number, like volume=150"
            raise SystemDescriptionError(sentence) from None
        if name.strip() in values:
            raise SystemDescriptionError(
                f"--{option} {item!r}: {name.strip()!r} is given twice; expected one value of it"
            )
        values[name.strip()] = value
    return values
