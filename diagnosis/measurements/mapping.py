"""The mapping: one TOML that says which column of a measurement file is which variable of a system.

Columns are mapped either to an output or input of the system (``[variables.NAME]``) or to a quantity of the weather
by pvlib's name (``[weather.NAME]``), which then feeds every input that the system takes from that weather column.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field, ValidationError, model_validator

from datagen.driving.weather import UNITS as WEATHER_UNITS
from shared.errors import RecordingError
from shared.reading import read_toml, short, shown
from shared.refused import meant
from shared.signals import Table

MEASURABLE = {**{name: WEATHER_UNITS[name] for name in WEATHER_UNITS if name != "wind_direction"}, "opaque_cover": "1"}
"""Weather quantities that a mapping may name, and the unit each is brought to. Cover is a share of the sky."""


class File(Table):
    """How the text file is written."""

    separator: str = Field(",", min_length=1, max_length=1)
    decimal: Literal[".", ","] = "."
    skip: int = Field(0, ge=0, lt=2**31, description="lines before the line of column names")
    encoding: str = "utf-8-sig"
    missing: list[str] = Field(["", "NA", "NaN", "nan", "null", "NULL", "None", "-"], description="texts for no value")


class Time(Table):
    """Where the time stamps are and how they are to be understood."""

    column: str
    zone: str = Field(description="IANA name, UTC, or an offset as +01:00: the place's clock")
    stamps: str | None = Field(None, description="the same of stamps without an offset; ``zone`` if not given")
    format: str = Field("ISO8601", description="ISO8601, unix (seconds), or a strptime format with a year")


class Place(Table):
    """Where the building stands; needed for the sun."""

    latitude: float = Field(ge=-90, le=90)
    longitude: float = Field(ge=-180, le=180)
    altitude: float = Field(0.0, ge=-500, le=9000, description="above the sea [m]")


class Grid(Table):
    """The regular grid of the recording."""

    step: float | None = Field(None, gt=0, description="[s]; the system's own step if not given")
    coverage: float = Field(0.5, gt=0, le=1, description="least share of a step that readings must cover for a mean")


class Meter(Table):
    """A second meter of the same quantity: compared and drawn, never used."""

    column: str
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    persons: float | None = Field(None, gt=0, description="unit presence: how many persons a presence stands for")

    @model_validator(mode="after")
    def _usable(self) -> Meter:
        if (self.unit == "presence") != (self.persons is not None):
            raise ValueError("has one of unit 'presence' and persons; expected both or neither")
        if self.scale == 0:
            raise ValueError("scale is 0; expected another number")
        return self


class Source(Table):
    """Where a variable comes from: a column, or one constant. Converted is ``scale * reading + offset`` in ``unit``."""

    column: str | None = None
    constant: float | None = None
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    persons: float | None = Field(None, gt=0, description="unit presence: how many persons a presence stands for")
    reading: Literal["point", "mean", "hold"] | None = Field(
        None,
        description="an instant, the mean of an interval, or a state that holds until the next reading; here or in"
        " defaults, needed where means over steps are made of readings about a step apart",
    )
    stamp: Literal["start", "end"] | None = Field(None, description="which end of its interval a mean is stamped with")
    shift: float = Field(0.0, description="added to the column's stamps, whose clock is known to be wrong [s]")
    interval: float | None = Field(None, gt=0, description="interval of a mean [s]; the usual spacing if not given")
    max_gap: float | None = Field(
        None,
        gt=0,
        description="readings further apart leave a gap, and a state holds no longer [h]; nearer ones of an output are"
        " joined over what was lost between, flagged as interpolated",
    )
    valid: tuple[float, float] | None = Field(None, description="possible values, in ``unit``")
    stuck_after: float | None = Field(
        None,
        ge=0,
        description="equal readings for longer are not believed [h]; 0: off; if not given, 12 h of what never stands"
        " still (of irradiance, with the sun 10 degrees high), and 120 h of no wind",
    )
    fill: Literal["none", "interpolate"] | float | None = Field(
        None, description="what an input's gaps are filled with: nothing, straight lines, or a constant in ``unit``"
    )
    fill_up_to: float = Field(3.0, gt=0, description="longest gap that straight lines bridge [h]")
    compare: Meter | None = None

    @model_validator(mode="after")
    def _one_origin(self) -> Source:
        if (self.column is None) == (self.constant is None):
            raise ValueError("has both or neither of column and constant; expected one of them")
        if self.valid is not None and not self.valid[0] < self.valid[1]:
            raise ValueError(f"valid is [{self.valid[0]:g}, {self.valid[1]:g}]; expected low < high")
        if self.unit == "presence" and self.persons is None:
            raise ValueError("unit is presence but persons is missing; expected how many persons a presence stands for")
        if self.unit != "presence" and self.persons is not None:
            raise ValueError(f"persons is given with unit {self.unit!r}; expected it with unit 'presence' only")
        if self.scale == 0:
            raise ValueError("scale is 0; expected another number")
        if self.fill not in (None, "interpolate") and "fill_up_to" in self.model_fields_set:
            raise ValueError(f"fill_up_to is given with fill = {self.fill!r}; expected fill = 'interpolate' with it")
        return self


class Defaults(Table):
    """What holds for every column that does not say otherwise."""

    reading: Literal["point", "mean", "hold"] = "point"
    stamp: Literal["start", "end"] = "end"


class Mapping(Table):
    """A mapping. Load one with :func:`load_mapping`."""

    schema_version: Literal[1]
    system: str | None = Field(None, description="system description, relative to the mapping's folder")
    description: str = ""
    source: str = Field("", description="where the measurements come from, and their licence")
    air_density: float = Field(1.2, gt=0, description="turns volume flows into mass flows [kg/m3]")
    file: File = File()
    time: Time
    place: Place | None = None
    grid: Grid = Grid()
    defaults: Defaults = Defaults()
    variables: dict[str, Source] = {}
    weather: dict[str, Source] = {}
    path: Path = Path()

    @model_validator(mode="after")
    def _known(self) -> Mapping:
        for name in self.weather:
            if name not in MEASURABLE:
                raise ValueError(f"weather: {name!r} is not known; expected one of {', '.join(MEASURABLE)}")
        for name, source in self.variables.items():  # those of the weather are interpolated anyway
            if source.fill is None and "fill_up_to" in source.model_fields_set:
                raise ValueError(
                    f"variables.{name}: fill_up_to is {source.fill_up_to:g} without fill; expected fill = 'interpolate'"
                    " with it, or neither for an output"
                )
        if not any(one.column for one in self.variables.values()):
            raise ValueError("variables: no column is mapped; expected at least one output of the system")
        return self


def load_mapping(path: Path | str) -> Mapping:
    """Read a mapping.

    Raises
    ------
    RecordingError
        If the file is missing, not TOML, or not a mapping: one sentence names the field.
    """
    path = Path(path)
    raw = read_toml(path, RecordingError, "a column mapping (TOML)")
    try:
        return Mapping.model_validate({**raw, "path": path})
    except ValidationError as error:
        raise RecordingError(f"{path}: {_sentence(error)}") from None


_TABLES: dict[str, type[Table]] = {
    "file": File, "time": Time, "place": Place, "grid": Grid, "defaults": Defaults,
}  # fmt: skip


def _known(where: tuple[int | str, ...]) -> str:
    """What a table of the mapping may hold, of a field in it that is not known, and which of it is meant."""
    if len(where) == 1:
        names, kind = [name for name in Mapping.model_fields if name != "path"], "one of"
    elif where[-2] == "compare":
        names, kind = list(Meter.model_fields), "fields"
    else:
        names, kind = list(_TABLES.get(str(where[0]), Source).model_fields), "fields"
    return f"; expected {kind} {', '.join(names)}{meant(str(where[-1]), names)}"


def _sentence(error: ValidationError) -> str:
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"])
    what = first["msg"].removeprefix("Value error, ")
    if first["type"] == "missing":
        what = "missing; expected a value"
    elif first["type"] == "extra_forbidden":
        what = f"unknown field (found {shown(first['input'])}){_known(first['loc'])}"
    elif first["type"] != "value_error":
        what = f"{what} (found {shown(first['input'])})"
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return f"{short(where)}: {short(what)}{more}" if where else f"{short(what)}{more}"
