"""The parts of a system description that say how its inputs are made: weather, occupancy, schedules, excitation."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

Span = tuple[float, float]


def _monday(value: int) -> int:
    if value:
        raise ValueError(
            f"is {value}; expected 0: time zero is Monday 1 January 2001 in every file, so that a weekend moved by this"
            " would not be that of the dates; a year that begins on another weekday is a matter of experiment.start"
        )
    return value


FirstWeekday = Annotated[int, AfterValidator(_monday)]
"""Weekday of time zero: Monday. Part of descriptions, and so of their hash, since it could be another."""


class Table(BaseModel, extra="forbid", frozen=True, allow_inf_nan=False):
    """A table of the description: unknown fields are refused, numbers are finite, nothing changes once it is read."""


class Weather(Table):
    """Weather files and the plane on which the sun is wanted (pvlib's nomenclature)."""

    files: list[str] = Field(
        min_length=1,
        description="EPW, TMY3, .mos, or the CSV of NSRDB, SAM or PVGIS; 'pvlib:NAME' is a file that pvlib ships",
    )
    surface_tilt: float = Field(90.0, ge=0, le=180, description="[degree] from horizontal")
    surface_azimuth: float = Field(180.0, ge=0, le=360, description="[degree] east of north")
    albedo: float = Field(0.2, ge=0, le=1, description="share of the sun that the ground reflects")
    transposition: Literal["isotropic", "haydavies", "perez"] = Field(
        "perez", description="model of the diffuse light on the plane"
    )


_MOST = {
    "headcount": math.inf,
    "arrival": 24.0,
    "duration": 24.0,
    "attendance": 1.0,
    "gaps": 24.0,
    "gap_duration": 24.0,
    "gap_share": 1.0,
}
"""Largest end of each span of an occupancy: hours of a day, shares, and absences that a day has room for."""


class Occupancy(Table):
    """A random schedule of persons. Spans are uniform distributions (low, high); times are in hours.

    Each system draws its headcount, its usual arrival and its usual length of day once; each day then draws
    whether anybody comes, how many, when, and when some of them leave for a while.
    """

    headcount: tuple[int, int] = Field(description="persons of a full day, once per system")
    density: Span | None = Field(
        None, description="of the headcount, per unit of the estimated parameter `per`; headcount limits it"
    )
    per: str = Field("", description="estimated parameter that the density is multiplied by, such as a floor area")
    arrival: Span = Field(description="usual start of the day, once per system [h]")
    duration: Span = Field(description="usual length of the day, once per system [h]")
    jitter: float = Field(ge=0, description="standard deviation of a day's start and end about the usual [h]")
    attendance: Span = Field(description="share of the headcount present on a day, of one at least")
    gaps: tuple[int, int] = Field(description="how often in a day some leave for a while")
    gap_duration: Span = Field(description="length of such an absence [h]")
    gap_share: Span = Field(description="share of those present who leave, one at least")
    absence: float = Field(ge=0, le=1, description="probability that nobody comes on a working day")
    weekend: float = Field(ge=0, le=1, description="probability that somebody comes on a day of the weekend")
    first_weekday: FirstWeekday = Field(0, description="weekday of time zero: 0, Monday")

    @model_serializer(mode="wrap")
    def _without_nothing(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """A description without a density has the hash that it had before there was one."""
        made: dict[str, Any] = handler(self)
        if self.density is None:
            made.pop("density", None), made.pop("per", None)
        return made

    @model_validator(mode="after")
    def _spans(self) -> Occupancy:
        if (self.density is None) != (not self.per):
            raise ValueError("density and per: one is given without the other; expected both, or none")
        if self.density is not None and not 0 <= self.density[0] <= self.density[1]:
            raise ValueError(f"density: span is {list(self.density)}; expected 0 <= low <= high")
        for name in _MOST:
            low, high = getattr(self, name)
            most = _MOST[name]
            if not 0 <= low <= high <= most:
                end = "" if most == math.inf else f" <= {most:g}"
                raise ValueError(f"{name}: span is [{low:g}, {high:g}]; expected 0 <= low <= high{end}")
        return self


class DrawnSchedule(Table):
    """A timetable that each system draws for itself: ``high`` within hours of the day, ``low`` outside of them."""

    low: Span = Field(description="value outside of the hours, once per system [unit of the input]")
    high: Span = Field(description="value within the hours, once per system [unit of the input]")
    begin: Span = Field(description="first hour, once per system [h]")
    end: Span = Field(description="last hour, once per system [h]")
    constant: float = Field(0.0, ge=0, le=1, description="share of the systems that have the high value at all times")
    weekends: float = Field(0.5, ge=0, le=1, description="share of the others whose weekends are as other days")

    @model_validator(mode="after")
    def _ordered(self) -> DrawnSchedule:
        if not 0 < self.begin[0] <= self.begin[1] < self.end[0] <= self.end[1] < 24:
            raise ValueError(
                f"begin and end: are {list(self.begin)} and {list(self.end)} h; expected begin before end, within a day"
            )
        return self


class Schedule(Table):
    """A value that changes at fixed hours of the day: lists of (hour, value), the first at hour 0.

    Values are in the unit of the input that names the schedule: temperatures in K for an input in K. Numbers beyond
    10 K that are no temperature in K but one in degC or degF are refused.
    """

    weekday: list[tuple[float, float]] = Field(min_length=1, description="(hour, value) [h, unit of the input]")
    weekend: list[tuple[float, float]] | None = Field(None, description="the same of Saturday and Sunday")
    drawn: DrawnSchedule | None = Field(None, description="what simulated systems have in its place")
    first_weekday: FirstWeekday = Field(0, description="weekday of time zero: 0, Monday")

    @model_serializer(mode="wrap")
    def _without_nothing(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """A schedule that is not drawn has the hash that it had before any was."""
        made: dict[str, Any] = handler(self)
        if self.drawn is None:
            made.pop("drawn", None)
        return made

    @model_validator(mode="after")
    def _ordered(self) -> Schedule:
        for name, rows in (("weekday", self.weekday), ("weekend", self.weekend)):
            hours = [hour for hour, _ in rows or []]
            if rows is not None and (hours[:1] != [0] or hours != sorted(set(hours)) or hours[-1] >= 24):
                raise ValueError(f"{name}: hours are {hours}; expected them to start at 0, increase, and stay below 24")
        return self


class Sinusoid(Table):
    """amplitude * sin(2 pi (t / period + phase))."""

    amplitude: float = Field(description="[unit of the input]")
    period: float = Field(ge=1 / 60, description="[h], a minute at least")
    phase: float = Field(0.0, description="share of a period")


class Excitation(Table):
    """A sum of sinusoids, the same for every system."""

    components: list[Sinusoid] = Field(min_length=1, description="which are added up")
