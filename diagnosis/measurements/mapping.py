"""The mapping: one TOML that says which column of a measurement file is which variable of a system.

Columns are mapped either to an output or input of the system (``[variables.NAME]``) or to a quantity of the weather
by pvlib's name (``[weather.NAME]``), which then feeds every input that the system takes from that weather column.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, Strict, ValidationError, field_validator, model_validator

from datagen.driving.weather import UNITS as WEATHER_UNITS
from diagnosis.measurements.register import POWERS
from diagnosis.measurements.units import convert
from diagnosis.measurements.zones import find_zone
from shared.errors import RecordingError
from shared.reading import read_toml, short, shown
from shared.refused import meant
from shared.signals import Table
from shared.system import System

MEASURABLE = {
    **{name: WEATHER_UNITS[name] for name in WEATHER_UNITS if name != "wind_direction"},
    "opaque_cover": "1",
    "relative_humidity": "1",
}
"""Weather quantities that a mapping may name, and the unit each is brought to. Cover is a share of the sky; of the
air's relative humidity and its temperature comes the dew point where none was measured."""
Number = Annotated[float, Strict()]
"""Not one in quotation marks, nor true for 1."""
Whole = Annotated[int, Strict()]
OPEN = "?"
"""What a draft writes where somebody has to fill something in."""


class File(Table):
    """How the file is written. Of Excel count ``skip``, ``below``, ``sheet`` and ``missing``, of Parquet the last."""

    separator: str = Field(",", min_length=1, max_length=1, description="between two columns")
    decimal: Literal[".", ","] = Field(".", description="the decimal sign")
    skip: Whole = Field(0, ge=0, lt=2**31, description="lines before the line of column names")
    below: Whole = Field(0, ge=0, le=100, description="lines between the column names and the readings, as of units")
    sheet: str | None = Field(None, description="the sheet of an Excel file; needed if several have cells")
    encoding: str = Field("utf-8-sig", description="of the text, as Python calls it")
    missing: list[str] = Field(["", "NA", "NaN", "nan", "null", "NULL", "None", "-"], description="texts for no value")
    names: str | None = Field(
        None,
        description="of a file with a row for each reading, as Home Assistant exports it: the column that says what was"
        " read; each of its texts is then a column",
    )
    values: str | None = Field(None, description="with ``names``: the column that holds the readings")

    @model_validator(mode="after")
    def _both(self) -> File:
        if (self.names is None) != (self.values is None):
            raise ValueError("has one of names and values; expected both, or neither")
        return self


class Time(Table):
    """Where the time stamps are and how they are to be understood."""

    column: str | list[str] = Field(description="a column, or several that are joined by a blank, as of date and time")
    zone: str | None = Field(
        None,
        description="IANA name, UTC, or an offset as +01:00: the place's clock; the stamps' own offset if not given",
    )
    stamps: str | None = Field(None, description="the same of stamps without an offset; ``zone`` if not given")
    format: str = Field(
        "ISO8601",
        description="ISO8601, unix (seconds since 1970 or parts of them), excel (days since 1899-12-30), or a strptime"
        " format with a year",
    )

    @property
    def columns(self) -> list[str]:
        """The columns of which the stamps are made."""
        return [self.column] if isinstance(self.column, str) else list(self.column)

    @field_validator("zone", "stamps")
    @classmethod
    def _known(cls, name: str | None) -> str | None:
        try:
            if name is not None:
                find_zone(name)
        except RecordingError as error:
            raise ValueError(str(error)) from None
        return name

    @field_validator("column")
    @classmethod
    def _some(cls, column: str | list[str]) -> str | list[str]:
        if not column:
            raise ValueError("is empty; expected a column's name, or those of date and time")
        return column


class Place(Table):
    """Where the building stands; needed for the sun."""

    latitude: Number = Field(ge=-90, le=90, description="[degree] north")
    longitude: Number = Field(ge=-180, le=180, description="[degree] east")
    altitude: Number = Field(0.0, ge=-500, le=9000, description="above the sea [m]")


class Grid(Table):
    """The regular grid of the recording."""

    step: Number | None = Field(None, gt=0, description="[s]; the system's own step if not given")
    coverage: Number = Field(0.5, gt=0, le=1, description="least share of a step that readings must cover for a mean")


class Meter(Table):
    """A second meter of the same quantity: compared and drawn, never used."""

    column: str = Field(description="a column of the file")
    unit: str = Field(description="what the column is in, as unit = 'degC'")
    scale: Number = Field(1.0, description="readings are multiplied by it")
    offset: Number = Field(0.0, description="and this is added [unit]")
    persons: Number | None = Field(None, gt=0, description="unit presence: how many persons a presence stands for")

    @model_validator(mode="after")
    def _usable(self) -> Meter:
        if (self.unit == "presence") != (self.persons is not None):
            raise ValueError("has one of unit 'presence' and persons; expected both or neither")
        if self.scale == 0:
            raise ValueError("scale is 0; expected another number")
        return self


class Source(Table):
    """Where a variable comes from: a column, or one constant. Converted is ``scale * reading + offset`` in ``unit``."""

    column: str | None = Field(None, description="a column of the file")
    constant: Number | None = Field(None, description="one value throughout [unit], in place of a column")
    unit: str = Field(description="what the column is in, as unit = 'degC'")
    scale: Number = Field(1.0, description="readings are multiplied by it")
    offset: Number = Field(0.0, description="and this is added [unit]")
    persons: Number | None = Field(None, gt=0, description="unit presence: how many persons a presence stands for")
    reading: Literal["point", "mean", "hold", "register"] | None = Field(
        None,
        description="an instant, the mean of an interval, a state that holds until the next reading, or a meter's"
        " register, which counts energy: its power is wanted; one of the first three, here or in defaults, is needed"
        " where means over steps come from readings about a step apart",
    )
    stamp: Literal["start", "end"] | None = Field(None, description="which end of its interval a mean is stamped with")
    shift: Number = Field(0.0, description="added to the column's stamps, whose clock is known to be wrong [s]")
    interval: Number | None = Field(None, gt=0, description="interval of a mean [s]; the usual spacing if not given")
    max_gap: Number | None = Field(
        None,
        gt=0,
        description="readings further apart leave a gap, and a state holds at most so long [h]; between nearer ones an"
        " output is interpolated, and flagged so",
    )
    valid: tuple[Number, Number] | None = Field(
        None, description="possible values, in ``unit``; of a register in its power, as kW for kWh"
    )
    stuck_after: Number | None = Field(
        None,
        ge=0,
        description="equal readings for longer are rejected [h]; 0: off; if not given, 12 h of what always varies (of"
        " irradiance, with the sun 10 degrees high), and 120 h of no wind",
    )
    fill: Literal["none", "interpolate"] | Number | None = Field(
        None, description="how an input's gaps are filled: not, by interpolation, or with a constant in ``unit``"
    )
    fill_up_to: Number = Field(3.0, gt=0, description="longest gap that is interpolated [h]")
    compare: Meter | None = Field(None, description="a second meter; see below")

    @model_validator(mode="after")
    def _one_origin(self) -> Source:
        wrong = []
        if (self.column is None) == (self.constant is None):
            wrong.append("has both or neither of column and constant; expected one of them")
        if self.valid is not None and not self.valid[0] < self.valid[1]:
            wrong.append(f"valid is [{self.valid[0]:g}, {self.valid[1]:g}]; expected low < high")
        if self.unit == "presence" and self.persons is None:
            wrong.append("unit is presence but persons is missing; expected how many persons a presence stands for")
        if self.unit != "presence" and self.persons is not None:
            wrong.append(f"persons is given with unit {self.unit!r}; expected it with unit 'presence' only")
        if self.scale == 0:
            wrong.append("scale is 0; expected another number")
        if self.reading == "register" and self.unit not in POWERS:
            wrong.append(f"reading is register with unit {self.unit!r}; expected an energy: {', '.join(POWERS)}")
        if self.fill not in (None, "interpolate") and "fill_up_to" in self.model_fields_set:
            wrong.append(f"fill_up_to is given with fill = {self.fill!r}; expected fill = 'interpolate' with it")
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    def as_power(self) -> Source:
        """What a register counts in a second, in the unit of its power; any other source as it is."""
        if self.reading != "register":
            return self
        power, factor = POWERS[self.unit]
        return self.model_copy(update={"unit": power, "scale": self.scale * factor, "offset": 0.0})


class Defaults(Table):
    """What holds for every column that does not say otherwise."""

    reading: Literal["point", "mean", "hold"] = Field("point", description="as of a column")
    stamp: Literal["start", "end"] = Field("end", description="as of a column")


def _of_the_weather(name: str) -> str:
    if name not in MEASURABLE:
        raise ValueError(f"is not known; expected one of {', '.join(MEASURABLE)}{meant(name, MEASURABLE)}")
    return name


class Mapping(Table):
    """A mapping. Load one with :func:`load_mapping`."""

    schema_version: Literal[1] = Field(description="schema_version = 1")
    system: str | None = Field(None, description="system description, relative to the mapping's folder")
    description: str = Field("", description="what is measured, for reports")
    source: str = Field("", description="where the measurements come from, and their licence")
    air_density: Number = Field(1.2, gt=0, description="turns volume flows into mass flows [kg/m3]")
    file: File = File()
    time: Time = Field(description="a table [time], with column and zone")
    place: Place | None = None
    grid: Grid = Grid()
    defaults: Defaults = Defaults()
    variables: dict[str, Source] = Field({}, validate_default=True)
    weather: dict[Annotated[str, AfterValidator(_of_the_weather)], Source] = {}
    given: dict[str, Number] = Field(
        {}, description="facts of the building, by the names of the description's `[[given]]`, each in its unit"
    )
    path: Path = Path()

    @field_validator("variables")
    @classmethod
    def _read(cls, variables: dict[str, Source]) -> dict[str, Source]:
        wrong = [
            f"{name}: fill_up_to is {source.fill_up_to:g} without fill; expected fill = 'interpolate' with it, or"
            " neither for an output"
            for name, source in variables.items()  # those of the weather are interpolated anyway
            if source.fill is None and "fill_up_to" in source.model_fields_set
        ]
        if wrong:
            raise ValueError("; ".join(wrong))
        return variables


def load_mapping(path: Path | str) -> Mapping:
    """Read a mapping.

    Raises RecordingError if the file is missing, not TOML, not filled in, or not a mapping: a sentence for each field.
    """
    path = Path(path)
    raw = read_toml(path, RecordingError, "a column mapping (TOML)")
    if empty := list(unfilled(raw)):
        places = ", ".join(f"{where}{EXAMPLES.get(where.rpartition('.')[2], '')}" for where in empty)
        raise RecordingError(f"{path}: has {OPEN!r} where something has to be filled in: {places}")
    try:
        return Mapping.model_validate({**raw, "path": path})
    except ValidationError as error:
        raise _refused(path, _sentences(error)) from None


EXAMPLES = {
    "zone": " (the place's clock, as 'Europe/Berlin')",
    "latitude": " (degrees north)",
    "longitude": " (degrees east)",
    "persons": " (how many persons a presence stands for)",
    "unit": " (what the column is in)",
    "format": " (as '%d/%m/%Y %H:%M')",
}
"""What is to be filled in, by the field."""


def unfilled(table: dict[str, Any], where: str = "") -> Iterator[str]:
    """Fields that a draft leaves to be filled in."""
    for name, value in table.items():
        if isinstance(value, dict):
            yield from unfilled(value, f"{where}{name}.")
        elif value == OPEN:
            yield f"{where}{name}"


def _refused(path: Path, wrong: Sequence[str]) -> RecordingError:
    """The error of all that is wrong in a mapping: one sentence, or one a line."""
    if len(wrong) == 1:
        return RecordingError(f"{path}: {wrong[0]}")
    more = [f"and {len(wrong) - _MOST} more"] if len(wrong) > _MOST else []
    return RecordingError("\n  ".join([f"{path}: has {len(wrong)} mistakes:", *wrong[:_MOST], *more]))


_LONG = 200
"""Letters of a name that are compared with others."""
_MOST = 30
"""Mistakes that are said at once."""


def check_against(mappings: Sequence[Mapping], system: System) -> None:
    """Refuse mappings of one recording that do not fit a system.

    Raises RecordingError that names all names that the system does not have, all units that cannot become those of the
    system, and what two mappings bring.
    """
    wanted = {one.name: one.unit for one in [*system.outputs, *system.inputs]}
    # measured weather is as warm as it was
    facts = [one.name for one in system.given if one.weather != "temperature_shift"]
    brought: dict[str, Path] = {}
    refused = []
    for mapping in mappings:
        wrong = []
        for name in mapping.given:
            if name not in facts:
                found = ", ".join(facts) or "none"
                wrong.append(f"given: {name!r} is no given fact of {system.name}; found {found}{meant(name, facts)}")
            elif (before := brought.setdefault(f"given.{name}", mapping.path)) != mapping.path:
                wrong.append(f"given.{name}: is in {before}, too; expected it in one of them")
        wrong += _shared_columns(mapping, system)
        sources = [
            ("variables", name, source.as_power(), wanted.get(name)) for name, source in mapping.variables.items()
        ]
        sources += [("weather", name, source, MEASURABLE[name]) for name, source in mapping.weather.items()]
        for table, name, source, unit in sources:
            if unit is None:
                wrong.append(
                    f"variables: {name!r} is neither output nor input of {system.name}; found {', '.join(wanted)}"
                    f"{meant(name, wanted)}"
                )
                continue
            if (before := brought.setdefault(f"{table}.{name}", mapping.path)) != mapping.path:
                wrong.append(f"{table}.{name}: is in {before}, too; expected it in one of them")
            for where, given in [("", source.unit), (".compare", source.compare.unit if source.compare else unit)]:
                try:
                    convert(0.0, given, unit, density=mapping.air_density, where=f"{table}.{name}{where}")
                except RecordingError as error:
                    wrong.append(str(error))
        refused += [str(_refused(mapping.path, wrong))] if wrong else []
    if not refused and not any(f"variables.{name}" in brought for name in system.output_names):
        refused = [
            f"{mappings[0].path}: variables: no output of {system.name} is mapped; expected one of"
            f" {', '.join(system.output_names)}"
        ]
    if refused:
        raise RecordingError("\n".join(refused))


def _shared_columns(mapping: Mapping, system: System) -> list[str]:
    """Sentences on columns that are taken for an output and for another output or the weather.

    An input may be an output's own readings, replayed.
    """
    outputs = {name: one for name, one in mapping.variables.items() if name in system.output_names}
    named = [(f"variables.{name}", one.column) for name, one in outputs.items()]
    others = [(f"weather.{name}", one.column) for name, one in mapping.weather.items()]
    return [
        f"{where}: column {column!r} is that of {other}, too; expected a column for each"
        for k, (where, column) in enumerate(named)
        for other, same in [*named[k + 1 :], *others]
        if column is not None and column == same
    ]


def missing_columns(mapping: Mapping, columns: Sequence[str]) -> list[str]:
    """Sentences on columns that a mapping names and a file does not have, each with the name that may be meant."""
    named = [("time.column", one) for one in mapping.time.columns]
    for table, sources in (("variables", mapping.variables), ("weather", mapping.weather)):
        for name, source in sources.items():
            named += [(f"{table}.{name}", source.column)] if source.column else []
            named += [(f"{table}.{name}.compare", source.compare.column)] if source.compare else []
    folded = {name.casefold(): name for name in columns}
    free = [one for one, name in folded.items() if name not in {column for _, column in named}]
    near = {one: get_close_matches(" ".join(one.casefold().split())[:_LONG], free, n=1) for _, one in named}
    return [
        f"{where}: no column {one!r}{f'; did you mean {folded[near[one][0]]}?' if near[one] else ''}"
        for where, one in named
        if one not in columns
    ]


_TABLES: dict[str, type[Table]] = {
    "file": File, "time": Time, "place": Place, "grid": Grid, "defaults": Defaults,
}  # fmt: skip
_EITHER = {
    "fill": "expected 'none', 'interpolate' or a number",
    "column": "expected a column's name in quotation marks",
    "valid": "expected two finite numbers, as [0.0, 100.0]",
}
"""What a field may hold that may hold several things."""
_EXPECTED = {
    "int_type": "a whole number, as 1",
    "string_type": "text in quotation marks",
    "list_type": 'a list, as ["NA", "-"]',
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "finite_number": "a number that is finite",
    "string_too_short": "one character",
    "string_too_long": "one character",
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "a number from {ge:g} on",
    "less_than": "a number below {lt:g}",
    "less_than_equal": "a number up to {le:g}",
    "literal_error": "{expected}",
}
"""What should stand in a field, by the kind of the mistake."""


def _fields(where: Sequence[int | str]) -> tuple[type[Table], str]:
    """The table in which a field stands, and what its fields are called in a sentence."""
    if len(where) == 1:
        return Mapping, "one of"
    return (Meter if where[-2] == "compare" else _TABLES.get(str(where[0]), Source)), "fields"


def _sentences(error: ValidationError) -> list[str]:
    """All that is wrong, a sentence each; what a field of several kinds is for each of them is said once."""
    said: dict[str, str] = {}
    for one in error.errors(include_url=False):
        where = list(one["loc"])
        cut = next((k for k, part in enumerate(where) if k and part in _EITHER), len(where) - 1)
        if where[-1] == "[key]":
            where.pop()
        elif one["type"] != "extra_forbidden":
            where = where[: cut + 1]
        place = short(".".join(str(part) for part in where))
        what = short(_mistake(one, where))
        said.setdefault(place, f"{place}: {what}" if place else what)
    return list(said.values())


def _mistake(one: Any, where: list[int | str]) -> str:
    kind, table = one["type"], _fields(where or [""])
    if kind == "value_error":
        return str(one["msg"]).removeprefix("Value error, ")
    if kind == "missing" and len(where) == len(one["loc"]):
        field = table[0].model_fields.get(str(where[-1]))
        return f"missing; expected {field.description if field is not None and field.description else 'a value'}"
    found = shown(one["input"])
    if kind == "extra_forbidden":
        names = [name for name in table[0].model_fields if name != "path"]
        return f"unknown field (found {found}); expected {table[1]} {', '.join(names)}{meant(str(where[-1]), names)}"
    if where and where[-1] in _EITHER:
        return f"is {found}; {_EITHER[str(where[-1])]}"
    number = "a number, without quotation marks" if isinstance(one["input"], str) else "a number"
    expected = _EXPECTED.get(kind, number).format(**one.get("ctx", {}))
    return f"is {found}; expected {expected}"
