"""Weather files as hourly records: TMY3 (.csv), EPW (.epw) and the Modelica form of TMY3 (.mos).

All three hold a common year of 8760 hours in local standard time. Row h is the hour that ends at h + 1 o'clock:
radiation is the mean over that hour, everything else is the reading at its end. (pvlib labels EPW rows by the
start of their hour; here the row's number counts, after its date has been checked.)
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import pvlib

from shared.errors import WeatherError
from shared.logs import logger
from shared.reading import MIB, size_of
from shared.variables import ZERO_CELSIUS

_log = logger(__name__)

HOURS = 8760
MOST = 64 * MIB
"""Bytes of a weather file; a year of hours takes two of them."""
BRIDGED = 12
"""Hours in a row up to which infrared radiation is put in. Without the column the sky's temperature is worked out from
dew point and cover, some kelvin away for the whole year."""
YEAR = 2001
"""The common year whose dates stand for the typical year (``shared.schema.EPOCH``)."""

REQUIRED = ("temp_air", "wind_speed", "pressure", "ghi", "dni", "dhi")
OPTIONAL = ("temp_dew", "wind_direction", "infrared", "opaque_cover")
_SPELLING = {
    "temp_air": "dry-bulb temperature",
    "wind_speed": "wind speed",
    "pressure": "atmospheric pressure",
    "ghi": "global horizontal radiation",
    "dni": "direct normal radiation",
    "dhi": "diffuse horizontal radiation",
    "temp_dew": "dew-point temperature",
    "wind_direction": "wind direction",
    "infrared": "horizontal infrared radiation",
    "opaque_cover": "opaque sky cover",
}
# Values outside are missing codes (99.9 degC, 999 m/s, 9999 W/m2, 99 tenths, -9900) or slips of the unit.
_PLAUSIBLE = {
    "temp_air": (190.0, 340.0),
    "wind_speed": (0.0, 110.0),
    "pressure": (30e3, 115e3),
    "ghi": (0.0, 1600.0),
    "dni": (0.0, 1600.0),
    "dhi": (0.0, 1600.0),
    "temp_dew": (180.0, 340.0),
    "wind_direction": (0.0, 360.0),
    "infrared": (20.0, 1000.0),
    "opaque_cover": (0.0, 10.0),
}


@dataclass(frozen=True, eq=False)
class HourlyRecord:
    """What a weather file holds, in SI.

    Attributes
    ----------
    columns
        Shape (8760,) each: temp_air, temp_dew [K], wind_speed [m/s], wind_direction [degree], pressure [Pa],
        ghi, dni, dhi (means of the hour), infrared [W/m2], opaque_cover [tenths].
    absent
        Columns that the file does not offer, and why.
    utc_offset
        Of local standard time [h].
    """

    columns: dict[str, np.ndarray]
    latitude: float
    longitude: float
    altitude: float
    utc_offset: float
    absent: dict[str, str] = field(default_factory=dict)


def read_hourly(path: Path) -> HourlyRecord:
    """Read a weather file by its ending.

    Raises
    ------
    WeatherError
        If the file is missing, is not what its ending says, or lacks values.
    """
    readers: dict[str, Callable[[Path], tuple[pd.DataFrame, dict[str, float]]]] = {
        ".csv": _read_tmy3,
        ".epw": _read_epw,
        ".mos": _read_mos,
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise WeatherError(f"{path}: ending is {path.suffix!r}; expected .csv (TMY3), .epw or .mos")
    if not path.exists():
        raise WeatherError(f"{path}: no such weather file; expected TMY3 (.csv), EPW (.epw) or Modelica (.mos)")
    if (size := size_of(path, WeatherError, "a weather file")) > MOST:
        raise WeatherError(
            f"{path}: has {size / MIB:.0f} MiB; expected a weather file, of at most {MOST / MIB:.0f} MiB"
        )
    try:
        frame, place = reader(path)
    except WeatherError:
        raise
    except OSError as error:
        raise WeatherError(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception as error:
        # the readers of other libraries raise whatever their parsing meets
        name = {".csv": "TMY3", ".epw": "EPW", ".mos": "Modelica"}[path.suffix.lower()]
        cause = f"{type(error).__name__}: {error}".splitlines()[0]
        raise WeatherError(f"{path}: not a readable {name} file ({cause})") from None
    return _checked(path, frame, place)


def _checked(path: Path, frame: pd.DataFrame, place: dict[str, float]) -> HourlyRecord:
    latitude, longitude, offset = place["latitude"], place["longitude"], place["utc_offset"]
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 180 and -14 <= offset <= 14):
        raise WeatherError(
            f"{path}: place is latitude {latitude:g}, longitude {longitude:g}, time zone {offset:g} h; "
            "expected degrees north, degrees east and hours east of Greenwich"
        )
    columns: dict[str, np.ndarray] = {}
    absent: dict[str, str] = {}
    for name in (*REQUIRED, *OPTIONAL):
        trouble = "is not there"
        if name in frame:
            values = pd.to_numeric(frame[name], errors="coerce").to_numpy(dtype=np.float64)
            low, high = _PLAUSIBLE[name]
            bad = np.flatnonzero(~((values >= low) & (values <= high)))
            if name == "infrared" and 0 < bad.size < HOURS:
                values = _bridged(path, values, bad)
                bad = np.flatnonzero(np.isnan(values))
            if not bad.size:
                columns[name] = np.ascontiguousarray(values)
                continue
            trouble = f"is missing or out of range in {bad.size} of {HOURS} hours, first in hour {bad[0] + 1}"
            trouble += f" ({values[bad[0]]:g}, expected {low:g} to {high:g} in SI)"
        if name in REQUIRED:
            raise WeatherError(f"{path}: {_SPELLING[name]} {trouble}; expected a value in every hour")
        absent[name] = f"{_SPELLING[name]} {trouble}"
    return HourlyRecord(columns, latitude, longitude, place["altitude"], offset, absent)


def _bridged(path: Path, values: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """Infrared radiation with its short gaps on straight lines, over the year's end where one lies there.

    Where a gap is longer all of ``bad`` become NaN. Either is told by a warning.
    """
    good = np.setdiff1d(np.arange(HOURS), bad)
    longest = int(np.diff(np.append(good, good[0] + HOURS)).max()) - 1
    short = longest <= BRIDGED
    _log.warning(
        "%s: %s is missing or out of range in %d of %d hours, first in hour %d, at most %d in a row: %s",
        *(path, _SPELLING["infrared"], bad.size, HOURS, bad[0] + 1, longest),
        "it is put in on straight lines" if short else "the sky's temperature is worked out without any of it",
    )
    values = values.copy()
    values[bad] = np.interp(bad, good, values[good], period=HOURS) if short else np.nan
    return values


def _check_hours(path: Path, month: np.ndarray, day: np.ndarray, hour: np.ndarray, first: int) -> None:
    """Rows must be the hours of a common year in order; ``first`` is what the first row calls its hour, 0 or 1."""
    if len(month) != HOURS:
        hint = " (a leap year: drop 29 February)" if len(month) == HOURS + 24 else ""
        raise WeatherError(f"{path}: found {len(month)} hourly rows{hint}; expected {HOURS}, one common year")
    expected = pd.date_range(f"{YEAR}-01-01 {first:02}:00", periods=HOURS, freq="h")
    wrong = np.flatnonzero((month != expected.month) | (day != expected.day) | (hour != expected.hour))
    if wrong.size:
        k = int(wrong[0])
        raise WeatherError(
            f"{path}: row {k + 1} is of {month[k]}/{day[k]} {hour[k]}:00; expected {expected[k].month}/"
            f"{expected[k].day} {expected[k].hour}:00, the hours of one year in order from 1 January"
        )


def _read_tmy3(path: Path) -> tuple[pd.DataFrame, dict[str, float]]:
    data, meta = pvlib.iotools.read_tmy3(path, map_variables=True)
    # by the ends of the hours: pvlib moves what would be 29 February to 1 March
    _check_hours(path, data.index.month.to_numpy(), data.index.day.to_numpy(), data.index.hour.to_numpy(), 1)
    frame = data.reset_index(drop=True).rename(columns={"OpqCld (tenths)": "opaque_cover"})
    return _to_si(frame, pressure=100.0), _place(meta)  # mbar


def _read_epw(path: Path) -> tuple[pd.DataFrame, dict[str, float]]:
    data, meta = pvlib.iotools.read_epw(path)
    _check_hours(path, data["month"].to_numpy(), data["day"].to_numpy(), data["hour"].to_numpy() - 1, 0)
    names = {
        "atmospheric_pressure": "pressure",
        "ghi_infrared": "infrared",
        "opaque_sky_cover": "opaque_cover",
    }
    frame = data.reset_index(drop=True).rename(columns=names)
    return _to_si(frame), _place(meta)


def _to_si(frame: pd.DataFrame, pressure: float = 1.0) -> pd.DataFrame:
    """Temperatures from degC to K, pressure by its factor to Pa; what is no number becomes NaN."""
    for name in ("temp_air", "temp_dew"):
        if name in frame:
            frame[name] = pd.to_numeric(frame[name], errors="coerce") + ZERO_CELSIUS
    if "pressure" in frame:
        frame["pressure"] = pd.to_numeric(frame["pressure"], errors="coerce") * pressure
    return frame


def _place(meta: dict[str, float]) -> dict[str, float]:
    return {
        "latitude": float(meta["latitude"]),
        "longitude": float(meta["longitude"]),
        "altitude": float(meta["altitude"]),
        "utc_offset": float(meta["TZ"]),
    }


# Columns of the table ``tab1`` by their number from 1, as every such file's header and the documentation of the
# Buildings library's ReaderTMY3 give them: temperatures in degC, pressure in Pa, radiation in Wh/m2 of the hour.
_MOS_COLUMNS = {
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


def _read_mos(path: Path) -> tuple[pd.DataFrame, dict[str, float]]:
    """Read a Modelica table. Lines that start with # are the header; one line declares ``double tab1(rows, 30)``.

    The row at time 0 repeats a neighbour, because the file starts there while its first reading is at 3600 s; some
    converters drop the row at the year's end. Time 0 stands for that end then.
    """
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    location = next((line for line in lines if line.upper().startswith("#LOCATION")), None)
    declared = next((k for k, line in enumerate(lines) if re.match(r"\s*(double|float)\s+\w+\s*\(", line)), None)
    if location is None or declared is None:
        what = "#LOCATION line" if location is None else "table declaration"
        raise WeatherError(f"{path}: has no {what}; expected a Modelica weather file with '#LOCATION,...' and 'tab1'")
    fields = location.split(",")
    try:
        latitude, longitude, offset, altitude = (float(text) for text in fields[6:10])
    except ValueError:
        raise WeatherError(
            f"{path}: #LOCATION line is {location!r}; expected latitude, longitude, time zone and altitude in "
            "fields 7 to 10"
        ) from None
    rows = [line.split("#")[0].replace(",", " ").replace(";", " ").split() for line in lines[declared + 1 :]]
    rows = [row for row in rows if row]
    lengths = {len(row) for row in rows}
    if not rows or min(lengths) < max(_MOS_COLUMNS) or len(lengths) > 1:
        raise WeatherError(
            f"{path}: rows have {', '.join(map(str, sorted(lengths))) or 'no'} columns; expected 30 in every row"
        )
    table = np.array(rows, dtype=np.float64)
    by_hour = {round(float(time) / 3600): k for k, time in enumerate(table[:, 0])}
    by_hour.setdefault(HOURS, by_hour.get(0, -1))
    odd = np.flatnonzero(np.abs(table[:, 0] / 3600 - np.round(table[:, 0] / 3600)) > 1e-6)
    missing = [hour for hour in range(1, HOURS + 1) if by_hour.get(hour, -1) < 0]
    if missing or odd.size or max(by_hour) > HOURS:
        found = f"{len(rows)} rows from {table[0, 0]:g} to {table[-1, 0]:g} s"
        raise WeatherError(f"{path}: found {found}; expected hourly rows over one common year, 0 to {HOURS * 3600} s")
    table = table[[by_hour[hour] for hour in range(1, HOURS + 1)]]
    frame = pd.DataFrame({name: table[:, number - 1] for number, name in _MOS_COLUMNS.items()})
    return _to_si(frame), {"latitude": latitude, "longitude": longitude, "altitude": altitude, "utc_offset": offset}
