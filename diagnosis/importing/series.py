"""A variable of the recording: its values on the regular grid, their flags, and where they come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from diagnosis.importing.quality import Signal
from shared.flags import MISSING
from shared.variables import Input, Output, WeatherInput

IRRADIANCES = ("ghi", "dni", "dhi", "poa_global")
"""pvlib's names of what the sun does."""


@dataclass(frozen=True)
class Target:
    """What the system description wants: ``method`` is CF's, the mean of a step or the instant at its end.

    ``sun`` says that it is irradiance of the weather, which is never negative.
    """

    name: str
    role: Literal["output", "input"]
    unit: str
    method: Literal["mean", "point"]
    sun: bool = False


def output_target(one: Output) -> Target:
    """What an output wants."""
    return Target(one.name, "output", one.unit, one.method)


def input_target(one: Input) -> Target:
    """What an input wants: held inputs the means of the steps, the others instants joined by straight lines."""
    sun = isinstance(one, WeatherInput) and one.column in IRRADIANCES
    return Target(one.name, "input", one.unit, "mean" if one.interpolation == "previous" else "point", sun)


@dataclass
class Series:
    """One variable on the grid.

    Attributes
    ----------
    values
        Shape (steps,) [unit of the target], NaN where there is none.
    flags
        Bits of :data:`shared.flags.FLAGS` without ``missing``, shape (steps,).
    origin
        Where it comes from, in a few words.
    comment
        The same at length, if there is more to say.
    signal
        The readings behind it, if there are any.
    second, second_name
        A second meter on the same grid, and its column.
    """

    target: Target
    origin: str
    values: np.ndarray
    flags: np.ndarray
    comment: str = ""
    signal: Signal | None = None
    second: np.ndarray | None = None
    second_name: str = ""

    def flagged(self) -> np.ndarray:
        """Flags with the bit of what is missing, (steps,)."""
        return (self.flags | np.where(np.isfinite(self.values), 0, MISSING)).astype(np.int8)

    def cut(self, first: int, last: int) -> None:
        """Keep the steps ``first`` to ``last`` (one past)."""
        self.values, self.flags = self.values[first:last], self.flags[first:last]
        self.second = None if self.second is None else self.second[first:last]
