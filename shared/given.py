"""Given facts: what differs from building to building, but is known to its engineer, or is drawn and never told."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from shared.signals import Table


class Given(Table):
    """A property of a building that is no estimated parameter, and that the farm draws for each system.

    Its value [unit] is uniform in ``scale`` between ``min`` and ``max``. It sets FMU parameters (in the FMU's unit), or
    a setting of the weather. An estimator reads it as a static input that may be unknown, unless it is ``hidden``.
    """

    name: str = Field(description="in datasets and reports")
    description: str = Field("", description="what it is, for reports")
    unit: str = Field(description="of min and max")
    min: float = Field(description="least value [unit]")
    max: float = Field(description="greatest value [unit]")
    scale: Literal["linear", "log"] = Field("linear", description="what it is uniform in: the value, or its logarithm")
    parameters: list[str] = Field([], description="FMU parameters that take the value")
    of: Literal["each", "sum"] = Field(
        "each", description="each parameter takes the value; or they are scaled so that their sum is the value"
    )
    per: str = Field("", description="estimated parameter that the drawn number is multiplied by to give the value")
    weather: Literal["", "surface_azimuth", "temperature_shift"] = Field(
        "", description="a setting of the weather in place of FMU parameters [degree, K]"
    )
    zero: float = Field(0.0, ge=0, lt=1, description="share of the systems whose value is 0")
    quantum: float = Field(0.0, ge=0, description="the drawn number is rounded to multiples of this; 0: not rounded")
    hidden: bool = Field(False, description="drawn, and never told to an estimator")

    @model_validator(mode="after")
    def _consistent(self) -> Given:
        if not self.min < self.max or (self.scale == "log" and self.min <= 0):
            raise ValueError(
                f"{self.name!r}: range is {self.min:g} to {self.max:g}; expected min < max, and min > 0 in log scale"
            )
        if bool(self.parameters) == bool(self.weather):
            raise ValueError(f"{self.name!r}: expected either parameters or weather, what the value sets")
        return self

    def from_unit(self, u: float) -> float:
        """The drawn number at a place from 0 to 1 in the range."""
        if u < self.zero:
            return 0.0
        u = (u - self.zero) / (1 - self.zero)
        value = self.min * (self.max / self.min) ** u if self.scale == "log" else self.min + (self.max - self.min) * u
        return float(np.round(value / self.quantum) * self.quantum) if self.quantum else float(value)


class Ratio(Table):
    """What goes together: the farm draws parameters again until ``over`` over ``under`` lies in its range.

    A room of 10 m2 with an air volume of 1500 m3 is no room.
    """

    over: str = Field(description="name of an estimated parameter")
    under: str = Field(description="name of another one")
    min: float = Field(ge=0, description="least ratio")
    max: float = Field(description="greatest ratio")

    def holds(self, values: dict[str, float]) -> bool:
        """Whether parameters, by name, are within the range."""
        return self.min <= values[self.over] / values[self.under] <= self.max
