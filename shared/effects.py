"""The candidates for the sim-to-real gap that a system description declares, and the shapes that drive them.

An effect has one amplitude whose zero is the base model. Four generic kinds: FMU parameters, an FMU parameter with a
shape over time, a recorded input, a sensor.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from shared.signals import FirstWeekday, Span, Table

Mode = Literal["control", "replay"]


class TimetableShape(Table):
    """1 within spans of hours of the day on some days of the week, 0 elsewhere."""

    form: Literal["timetable"]
    hours: list[Span] = Field(min_length=1, description="(from, to) [h]; from > to runs past midnight")
    days: Literal["all", "weekday", "weekend"] = Field("all", description="the days on which a span begins")
    first_weekday: FirstWeekday = Field(0, description="weekday of time zero: 0, Monday")

    @model_validator(mode="after")
    def _hours(self) -> TimetableShape:
        for first, last in self.hours:
            if not (0 <= first < 24 and 0 <= last <= 24 and first != last):
                raise ValueError(f"hours: span is [{first:g}, {last:g}]; expected two different hours of a day")
        return self


class DiurnalShape(Table):
    """A sine of the day: 1 at the hour ``peak``, -1 twelve hours later."""

    form: Literal["diurnal"]
    peak: float = Field(ge=0, lt=24, description="[h]")


class ThresholdShape(Table):
    """1 / (1 + exp(-(x - threshold) / width)) of a series: a smooth step; a negative width turns it round."""

    form: Literal["threshold"]
    series: str = Field(description="an output or an input of the description")
    threshold: float = Field(description="[unit of the series]")
    width: float = Field(description="[unit of the series]")

    @model_validator(mode="after")
    def _width(self) -> ThresholdShape:
        if self.width == 0:
            raise ValueError("width: is 0; expected a width over which the step is smooth")
        return self


class PresenceShape(Table):
    """x / (x + half) of a series that is not negative: 0 where it is 0, and near 1 far above ``half``."""

    form: Literal["presence"]
    series: str = Field(description="an output or an input of the description")
    half: float = Field(1.0, gt=0, description="[unit of the series]")


class SeriesShape(Table):
    """(x - origin) / reference of a series."""

    form: Literal["series"]
    series: str = Field(description="an output or an input of the description")
    reference: float = Field(1.0, description="[unit of the series]")
    origin: float = Field(0.0, description="[unit of the series]")

    @model_validator(mode="after")
    def _reference(self) -> SeriesShape:
        if self.reference == 0:
            raise ValueError("reference: is 0; expected what the series is divided by")
        return self


Shape = Annotated[
    TimetableShape | DiurnalShape | ThresholdShape | PresenceShape | SeriesShape, Field(discriminator="form")
]


class _Effect(Table):
    """What all kinds have. ``modes``: whether the effect can act under the control loops, in replay, or both."""

    name: str = Field(description="in reports")
    unit: str = Field(description="of the amplitude")
    description: str = Field("", description="what it is, for reports")
    scale: float = Field(gt=0, description="standard deviation expected of the amplitude [unit]")
    lower: float = Field(description="least amplitude [unit], <= 0")
    upper: float = Field(description="greatest amplitude [unit], >= 0")
    modes: list[Mode] = Field(
        ["control", "replay"],
        min_length=1,
        description="whether it can act under the control loops, in replay, or both",
    )

    @model_validator(mode="after")
    def _bounds(self) -> _Effect:
        if not (math.isfinite(self.lower) and math.isfinite(self.upper)):
            raise ValueError(f"{self.name!r} has no bounds; expected finite lower and upper")
        if not self.lower <= 0 <= self.upper or self.lower == self.upper:
            raise ValueError(
                f"{self.name!r} goes from {self.lower:g} to {self.upper:g}; expected a range with 0, the base model"
            )
        return self


class ParameterEffect(_Effect):
    """FMU parameters: each is ``base`` + amplitude * ``parameters``; ``constants`` are set while it is not zero."""

    kind: Literal["parameter"]
    parameters: dict[str, float] = Field(min_length=1, description="change for an amplitude of 1")
    base: dict[str, float] = Field({}, description="values of the base model that are not 0, held against it")
    constants: dict[str, float] = Field({}, description="FMU parameters that are set while the amplitude is not 0")

    @model_validator(mode="after")
    def _known(self) -> ParameterEffect:
        for name in self.base:
            if name not in self.parameters:
                raise ValueError(f"{self.name!r} has a base for {name!r}, which is not one of its parameters")
        return self


class ShapedEffect(_Effect):
    """FMU parameters that are 0 in the base model, and an FMU input that says when: the product of shapes."""

    kind: Literal["shaped"]
    parameters: dict[str, float] = Field(min_length=1, description="change for an amplitude of 1")
    constants: dict[str, float] = Field({}, description="FMU parameters that are set while the amplitude is not 0")
    input: str = Field(description="the FMU input that takes the shape")
    shape: list[Shape] = Field(min_length=1, description="whose product it is; see shapes")


class InputEffect(_Effect):
    """An input is not what was recorded or scheduled.

    ``add``: x + amplitude * factor * shape; ``gain``: x * (1 + amplitude * factor * shape), at least 0 of x;
    ``shift``: x, later by amplitude * factor [s]. Without shapes the shape is 1.
    """

    kind: Literal["input"]
    input: str = Field(description="the input that is not what was recorded")
    operation: Literal["add", "gain", "shift"] = Field(description="how; see above")
    factor: float = Field(1.0, description="of the amplitude, as from its unit to that of the input")
    shape: list[Shape] = Field([], description="when it acts; see shapes")

    @model_validator(mode="after")
    def _shift(self) -> InputEffect:
        if self.operation == "shift" and self.shape:
            raise ValueError(f"{self.name!r} shifts in time; expected no shape")
        return self


class SensorEffect(_Effect):
    """A sensor does not show what is there.

    ``bias``: y + a; ``gain``: y + a * (y - about); ``lag``: first order with time constant a; ``drift``: y + a * days
    since the recording's start / 30; ``shift``: the clock of the sensors is late by a; with a = amplitude * factor
    [unit of the output; s for lag and shift].

    ``replayed``: by output, the FMU input that carries this sensor's reading in replay; the model gets it corrected.
    ``fed_back``: FMU inputs from which the bias is subtracted: the set point of a controller that reads this sensor.
    """

    kind: Literal["sensor"]
    outputs: list[str] = Field(min_length=1, description="whose sensors are meant")
    operation: Literal["bias", "gain", "lag", "drift", "shift"] = Field(description="how; see above")
    factor: float = Field(1.0, description="of the amplitude, as from its unit to that of the output")
    about: float = Field(0.0, description="value at which a gain changes nothing [unit of the output]")
    replayed: dict[str, str] = Field({}, description="by output, the FMU input that carries its reading in replay")
    fed_back: list[str] = Field([], description="FMU inputs from which the bias is subtracted: set points")

    @model_validator(mode="after")
    def _fits(self) -> SensorEffect:
        if self.operation == "lag" and self.lower < 0:
            raise ValueError(f"{self.name!r} is a lag from {self.lower:g} on; expected lower = 0")
        if self.operation == "lag" and self.factor <= 0:
            raise ValueError(f"{self.name!r} is a lag with factor {self.factor:g}; expected more than 0")
        if self.fed_back and self.operation != "bias":
            raise ValueError(f"{self.name!r} is fed back; expected a bias, found a {self.operation}")
        if self.replayed and self.operation not in ("bias", "gain", "shift"):
            raise ValueError(f"{self.name!r} is replayed; expected a bias, gain or shift, found a {self.operation}")
        for name in self.replayed:
            if name not in self.outputs:
                raise ValueError(f"{self.name!r} is replayed for {name!r}, which is not one of its outputs")
        least = min(self.lower * self.factor, self.upper * self.factor)
        if self.operation == "gain" and least <= -1:
            raise ValueError(f"{self.name!r} reaches a gain of {1 + least:g}; expected more than 0")
        return self


Effect = Annotated[ParameterEffect | ShapedEffect | InputEffect | SensorEffect, Field(discriminator="kind")]
"""A candidate for the sim-to-real gap: an amplitude whose zero is the base model."""
