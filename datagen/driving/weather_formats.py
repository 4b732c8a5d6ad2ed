"""Forms of weather files, each by its own reader: EPW, TMY3, Modelica, SAM and NSRDB, PVGIS.

A reader makes :class:`Rows` of the text: numbers in SI in the file's own order, and what its stamps mean. It is chosen
by what the text holds. What the forms share is read alike: a byte order mark, Latin-1, semicolons or tabs between
fields, decimal commas, quoted names, empty fields at the end of a line. pvlib has readers for most of these forms,
too. They follow the letter of each form, and say of anything else what their parser met; the tests hold the numbers
against theirs.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from datagen.driving.weather_record import HOURS, YEAR
from shared.errors import WeatherError
from shared.reading import MIB, read_bytes, shown
from shared.variables import ZERO_CELSIUS

MOST = 64 * MIB
"""Bytes of a weather file; a year of hours takes two of them."""
FORMS = "EPW, TMY3, Modelica (.mos), the CSV of NSRDB or SAM, or PVGIS's CSV"

_FACTORS = {"mbar": 100.0}
_ORDER = ("latitude", "longitude", "time zone", "altitude")
_SHOWN = 60
"""Characters of a line that a sentence shows."""


@dataclass(frozen=True, eq=False)
class Rows:
    """A weather file's rows as they stand in it.

    Attributes
    ----------
    form
        Name of the file's form.
    place
        Latitude, longitude [degree], altitude [m], and the time zone of the stamps [h].
    columns
        Numbers in SI, NaN where there is none, shape (n,) each; ``humidity`` in percent is one of them.
    month, day, hour
        Stamps, shape (n,) each; hours may have a fraction.
    lines
        Line of each row in the file, shape (n,).
    means
        ``start`` or ``end`` of the hour is what a stamp names; of ``instant`` a row holds its readings.
    beam_later
        Radiation of instants is so much later than their stamps [h].
    local_offset
        Of local standard time [h], where the file says that the stamps have another; NaN where they have another and
        it does not say which.
    """

    form: str
    place: dict[str, float]
    columns: dict[str, np.ndarray]
    month: np.ndarray
    day: np.ndarray
    hour: np.ndarray
    lines: np.ndarray
    means: Literal["start", "end", "instant"] = "end"
    beam_later: float = 0.0
    local_offset: float | None = None


def read_rows(path: Path) -> Rows:
    """Read a weather file's rows in whichever form it is.

    Raises WeatherError if it cannot be read, has no known form, or lines that are not of its form.
    """
    text = _decoded(read_bytes(path, WeatherError, f"a weather file ({FORMS})", MOST))
    lines = re.split(r"\r\n|\n|\r", text)
    reader = _reader_of(lines)
    if reader is None:
        raise WeatherError(f"{path}: {_unknown(text, lines)}; expected {FORMS}")
    return reader(path, lines)


def _decoded(content: bytes) -> str:
    """Text of any encoding: only names of places have letters that differ, and these are not used."""
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _reader_of(lines: Sequence[str]) -> Callable[[Path, Sequence[str]], Rows] | None:
    head = [line.strip().strip('"').lower() for line in lines[:3]] + ["", "", ""]
    if head[0].startswith("#") or head[0].startswith("double "):
        return _read_mos
    if "date (mm/dd/yyyy)" in head[1]:
        return _read_tmy3
    if head[0].startswith("latitude (decimal degrees)"):
        return _read_pvgis
    if head[2].startswith("year") and "month" in head[2] and "hour" in head[2]:
        return _read_sam
    if head[0].startswith("location"):
        return _read_epw
    return None


def _unknown(text: str, lines: Sequence[str]) -> str:
    """What a text is that no reader knows, and what to do about it."""
    if not text.strip("\0\r\n\t "):
        return "is empty"
    if text.startswith("PK\x03\x04") or text.startswith("\x1f\x8b"):
        return "is a compressed archive, so unpack it and name the weather file in it"
    if text.lstrip()[:1] in ("{", "["):
        return "is JSON, so download the same as CSV or EPW"
    if text.lstrip()[:1] == "<":
        return "is a web page or XML, so download the file itself"
    if re.match(r"\s?\d{5} .{22} ", lines[0]):
        return "looks like TMY2, so convert it, or take the station's TMY3 file"
    first = next(line for line in lines if line.strip())
    if first.lower().startswith("time(utc)"):
        return "has the rows of PVGIS without the lines about the place before them, so download it again as CSV"
    if re.match(r",?year,month,day,hour|date \(mm", first.lower()):
        return "has rows without the lines about the place before them, so put these back"
    return f"begins with {shown(first[:_SHOWN])}, as no weather file does that is read here, so save it in another form"


# ---------------------------------------------------------------- what the forms share


def _fields(line: str) -> list[str]:
    """Fields of a line, with decimal points."""
    separator = max(";\t,", key=line.count) if line.count(";") + line.count("\t") > 2 else ","
    if separator != ",":
        line = line.replace(",", ".")
    if '"' not in line:
        return [one.strip() for one in line.split(separator)]
    try:
        return [one.strip() for one in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:  # a field without end
        return [one.strip() for one in line.split(separator)]


def _table(path: Path, form: str, lines: Sequence[str], first: int, least: int) -> tuple[list[list[str]], np.ndarray]:
    """Fields of all lines from number ``first`` (from 0) on that are not empty, and their numbers from 1.

    Raises WeatherError if one has fewer than ``least`` fields.
    """
    rows, numbers = [], []
    for number, line in enumerate(lines[first:], first + 1):
        if not line.strip(",;\t \0\x1a"):
            continue
        fields = _fields(line)
        if len(fields) < least:
            raise WeatherError(
                f"{path}: line {number} is {shown(line[:_SHOWN])}, with {len(fields)} fields; expected at least {least}"
                f" in each row of {form}: mend the line, or download the file again"
            )
        rows.append(fields)
        numbers.append(number)
    if not rows:
        raise WeatherError(f"{path}: has no rows below the header of {form}; expected one for each hour of a year")
    return rows, np.array(numbers)


def _numbers(rows: Sequence[Sequence[str]], column: int) -> np.ndarray:
    """A column as numbers, NaN where there is none, shape (rows,)."""
    texts = [row[column] if column < len(row) else "" for row in rows]
    try:
        return np.array(texts, dtype=np.float64)
    except ValueError:
        return np.array([_number(text) for text in texts])


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _in_si(columns: dict[str, np.ndarray], pressure: str = "Pa") -> dict[str, np.ndarray]:
    """Temperatures from degC, and pressure from its unit."""
    for name in ("temp_air", "temp_dew"):
        if name in columns:
            columns[name] = columns[name] + ZERO_CELSIUS
    if "pressure" in columns:
        columns["pressure"] = columns["pressure"] * _FACTORS.get(pressure, 1.0)
    return columns


def _place(path: Path, line: str, what: str, order: Sequence[str], *, last: bool) -> dict[str, float]:
    """Numbers about the place on a header's line: the last or the first four in a row that can be a place.

    A comma in the place's name moves them. Raises WeatherError if there are not four numbers in a row.
    """
    fields = _fields(line)
    if last and len(fields) == 11 and all(re.fullmatch(r"-?\d+", one) for one in fields[8:]):
        fields[8:10] = [".".join(fields[8:10])]  # a time zone of "5,5"
    numbers = [_number(one) for one in fields]
    starts = [k for k in range(1, len(numbers) - 3) if np.isfinite(numbers[k : k + 4]).all()]
    places = [dict(zip(order, numbers[k : k + 4], strict=True)) for k in (starts[::-1] if last else starts)]
    if not places:
        raise WeatherError(
            f"{path}: {what} is {shown(line[:200])}; expected {', '.join(order)} as numbers in a row in it"
        )
    return next((one for one in places if is_on_earth(one)), places[0])


def is_on_earth(place: Mapping[str, float]) -> bool:
    """Whether latitude, longitude [degree], time zone [h] and altitude [m] can be those of a place."""
    reach = {"latitude": 90.0, "longitude": 180.0, "time zone": 14.0}
    return all(abs(place[name]) <= most for name, most in reach.items()) and -500 <= place["altitude"] <= 9000


def _named(header: Sequence[str], names: Mapping[str, str]) -> dict[str, int]:
    """Number of the field of each known column; a header's unit in brackets is passed over."""
    found: dict[str, int] = {}
    for k, text in enumerate(header):
        name = names.get(text.split("(")[0].strip().lower())
        if name is not None:
            found.setdefault(name, k)
    return found


# ---------------------------------------------------------------- EPW

# Fields by their number from 0, after the auxiliary programs of EnergyPlus: temperatures in degC, radiation in Wh/m2 of
# the hour before. Some converters leave out the last ones.
_EPW = {
    6: "temp_air",
    7: "temp_dew",
    8: "humidity",
    9: "pressure",
    12: "infrared",
    13: "ghi",
    14: "dni",
    15: "dhi",
    20: "wind_direction",
    21: "wind_speed",
    23: "opaque_cover",
}


def _read_epw(path: Path, lines: Sequence[str]) -> Rows:
    place = _place(path, lines[0], "line 1", _ORDER, last=True)
    head = next((k for k, line in enumerate(lines) if line.strip().upper().startswith("DATA PERIODS")), None)
    if head is None:
        raise WeatherError(f"{path}: has no DATA PERIODS line; expected that line of an EPW file above its rows")
    rows, numbers = _table(path, "EPW", lines, head + 1, max(k for k, n in _EPW.items() if n != "opaque_cover") + 1)
    columns = {name: _numbers(rows, k) for k, name in _EPW.items()}
    month, day, hour = (_numbers(rows, k) for k in (1, 2, 3))
    # PVGIS's are of instants, and say how much later the satellite saw the place
    offsets = re.search(r"Irradiance Time Offset \(h\):\s*(-?\d+(\.\d+)?)", "\n".join(lines[:head]), re.IGNORECASE)
    kind: Literal["start", "end", "instant"] = "start" if hour[0] == 0 else "end"
    later = 0.0
    if offsets is not None and kind == "end":
        kind, later = "instant", float(offsets.group(1)) % 1.0
    return Rows("EPW", place, _in_si(columns), month, day, hour, numbers, kind, later)


# ---------------------------------------------------------------- TMY3

_TMY3 = {
    "ghi": "ghi",
    "dni": "dni",
    "dhi": "dhi",
    "opqcld": "opaque_cover",
    "dry-bulb": "temp_air",
    "dew-point": "temp_dew",
    "rhum": "humidity",
    "pressure": "pressure",
    "wdir": "wind_direction",
    "wspd": "wind_speed",
}


def _read_tmy3(path: Path, lines: Sequence[str]) -> Rows:
    place = _place(path, lines[0], "line 1", ("time zone", "latitude", "longitude", "altitude"), last=False)
    fields = _named(_fields(lines[1]), _TMY3)
    rows, numbers = _table(path, "TMY3", lines, 2, 3)
    columns = {name: _numbers(rows, k) for name, k in fields.items()}
    date = [re.split(r"[/.-]", row[0]) for row in rows]
    clock = [row[1].split(":") for row in rows]
    month, day = _numbers(date, 0), _numbers(date, 1)
    hour = _numbers(clock, 0) + np.nan_to_num(_numbers(clock, 1)) / 60.0
    kind: Literal["start", "end"] = "start" if hour[0] < 1 else "end"
    hour = np.floor(hour) if kind == "start" else hour
    return Rows("TMY3", place, _in_si(columns, "mbar"), month, day, hour, numbers, kind)


# ---------------------------------------------------------------- SAM and NSRDB

_SAM = {
    "ghi": "ghi",
    "gh": "ghi",
    "global": "ghi",
    "dni": "dni",
    "dn": "dni",
    "beam": "dni",
    "dhi": "dhi",
    "df": "dhi",
    "diffuse": "dhi",
    "temperature": "temp_air",
    "tdry": "temp_air",
    "dry-bulb": "temp_air",
    "dew point": "temp_dew",
    "tdew": "temp_dew",
    "dew-point": "temp_dew",
    "relative humidity": "humidity",
    "rh": "humidity",
    "rhum": "humidity",
    "pressure": "pressure",
    "pres": "pressure",
    "wind direction": "wind_direction",
    "wdir": "wind_direction",
    "wind speed": "wind_speed",
    "wspd": "wind_speed",
    "month": "month",
    "day": "day",
    "hour": "hour",
    "minute": "minute",
}
_SAM_PLACE = {
    "latitude": "latitude",
    "lat": "latitude",
    "longitude": "longitude",
    "lon": "longitude",
    "elevation": "altitude",
    "elev": "altitude",
    "altitude": "altitude",
    "time zone": "time zone",
    "timezone": "time zone",
    "tz": "time zone",
    "local time zone": "local_offset",
    "source": "source",
}


def _read_sam(path: Path, lines: Sequence[str]) -> Rows:
    """Names and values of the place on two lines, then names of columns. NSRDB's stamps are of instants."""
    about, values = _fields(lines[0]), _fields(lines[1])
    said = {name: values[k] if k < len(values) else "" for name, k in _named(about, _SAM_PLACE).items()}
    place = {name: _number(said.get(name, "")) for name in _ORDER}
    for name, number in place.items():
        if not np.isfinite(number):
            raise WeatherError(
                f"{path}: {name} is {shown(said.get(name, ''))}; expected a number on line 2 under its name on"
                " line 1: Latitude, Longitude, Elevation and Time Zone"
            )
    fields = _named(_fields(lines[2]), _SAM)
    rows, row_lines = _table(path, "NSRDB or SAM", lines, 3, 4)
    columns = {name: _numbers(rows, k) for name, k in fields.items()}
    month, day, hour = (columns.pop(name, np.full(len(rows), np.nan)) for name in ("month", "day", "hour"))
    minute = columns.pop("minute", None)
    kind: Literal["start", "end", "instant"] = "end" if hour[0] == 1 else "start"
    if minute is not None and kind == "start" and (minute.any() or said.get("source", "").upper() == "NSRDB"):
        kind, hour = "instant", hour + minute / 60.0
    number = _number(said.get("local_offset", ""))
    local = number if np.isfinite(number) else None
    columns = _in_si(columns, "mbar")
    return Rows("NSRDB or SAM", place, columns, month, day, hour, row_lines, kind, local_offset=local)


# ---------------------------------------------------------------- PVGIS

_PVGIS = {
    "T2m": "temp_air",
    "RH": "humidity",
    "G(h)": "ghi",
    "Gb(n)": "dni",
    "Gd(h)": "dhi",
    "IR(h)": "infrared",
    "WS10m": "wind_speed",
    "WD10m": "wind_direction",
    "SP": "pressure",
}


def _read_pvgis(path: Path, lines: Sequence[str]) -> Rows:
    """Instants in UTC; those of the radiation are later, by when the satellite sees the place."""
    head = next((k for k, line in enumerate(lines) if line.lower().startswith("time(utc)")), None)
    if head is None:
        raise WeatherError(f"{path}: has no line that begins with 'time(UTC)'; expected PVGIS's typical year as CSV")
    about = {
        name.split("(")[0].strip().lower(): _number(value.strip(" ,;\t"))
        for name, _, value in (line.partition(":") for line in lines[:head])
    }
    for name in ("latitude", "longitude", "elevation"):
        if not np.isfinite(about.get(name, np.nan)):
            raise WeatherError(
                f"{path}: has no line with its {name} above its rows; expected '{name.title()} (..): 1.5'"
            )
    header = _fields(lines[head])
    end = next((k for k in range(head + 1, len(lines)) if not re.match(r"\d{8}", lines[k])), len(lines))
    rows, numbers = _table(path, "PVGIS", lines[:end], head + 1, 2)
    columns = {_PVGIS[text]: _numbers(rows, k) for k, text in enumerate(header) if text in _PVGIS}
    month, day = (np.array([_number(row[0][k : k + 2]) for row in rows]) for k in (4, 6))
    hour = np.array([_number(row[0][9:11]) + _number(row[0][11:13]) / 60.0 for row in rows])
    place = dict(zip(_ORDER, (about["latitude"], about["longitude"], 0.0, about["elevation"]), strict=True))
    later = float(np.nan_to_num(about.get("irradiance time offset", 0.0)))
    return Rows("PVGIS", place, _in_si(columns), month, day, hour, numbers, "instant", later, np.nan)


# ---------------------------------------------------------------- Modelica

# Columns of the table ``tab1`` by their number from 1, as every such file's header and the documentation of the
# Buildings library's ReaderTMY3 give them: temperatures in degC, pressure in Pa, radiation in Wh/m2 of the hour.
_MOS = {
    2: "temp_air",
    3: "temp_dew",
    5: "pressure",
    8: "infrared",
    9: "ghi",
    10: "dni",
    11: "dhi",
    16: "wind_direction",
    17: "wind_speed",
    19: "opaque_cover",
}


def _read_mos(path: Path, lines: Sequence[str]) -> Rows:
    """Read a Modelica table. Lines that start with # are the header; one line declares ``double tab1(rows, 30)``.

    The row at time 0 repeats a neighbour, because the file starts there while its first reading is at 3600 s; some
    converters drop the row at the year's end. Time 0 stands for that end then.
    """
    location = next((line for line in lines if line.upper().startswith("#LOCATION")), None)
    declared = next((k for k, line in enumerate(lines) if re.match(r"\s*(double|float)\s+\w+\s*\(", line)), None)
    if location is None or declared is None:
        what = "#LOCATION line" if location is None else "table declaration"
        raise WeatherError(f"{path}: has no {what}; expected a Modelica weather file with '#LOCATION,...' and 'tab1'")
    place = _place(path, location, "#LOCATION line", _ORDER, last=True)
    numbers = [k for k in range(declared + 1, len(lines)) if lines[k].split("#")[0].strip()]
    rows = [lines[k].split("#")[0].replace(",", " ").replace(";", " ").split() for k in numbers]
    lengths = {len(row) for row in rows}
    if not rows or min(lengths) < max(_MOS) or len(lengths) > 1:
        raise WeatherError(
            f"{path}: rows have {', '.join(map(str, sorted(lengths))) or 'no'} columns; expected 30 in every row"
        )
    time = _numbers(rows, 0)
    hours = np.round(time / 3600.0)
    whole = np.isfinite(time).all() and (np.abs(time / 3600.0 - hours) < 1e-6).all()
    by_hour = {int(hour): k for k, hour in enumerate(hours)} if whole else {}
    by_hour.setdefault(HOURS, by_hour.get(0, -1))
    order = [by_hour.get(hour, -1) for hour in range(1, HOURS + 1)]
    if min(order) < 0 or max(by_hour) > HOURS:
        found = f"{len(rows)} rows from {time[0]:g} to {time[-1]:g} s"
        raise WeatherError(f"{path}: found {found}; expected hourly rows over one common year, 0 to {HOURS * 3600} s")
    rows = [rows[k] for k in order]
    columns = {name: _numbers(rows, number - 1) for number, name in _MOS.items()}
    dates = pd.date_range(f"{YEAR}-01-01", periods=HOURS, freq="h")
    stamps = (dates.month.to_numpy(), dates.day.to_numpy(), dates.hour.to_numpy() + 1.0)
    return Rows("Modelica", place, _in_si(columns), *stamps, np.array([numbers[k] + 1 for k in order]))
