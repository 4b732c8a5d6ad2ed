"""Weather files as hourly records, whatever their form: :mod:`datagen.driving.weather_formats` says which are read.

A record holds a common year of 8760 hours in local standard time. Row h is the hour that ends at h + 1 o'clock:
radiation is the mean over that hour, everything else is the reading at its end. Files name their rows by an hour's
end, its start, or an instant, in local time or in UTC; here the stamps are checked, and rows moved to their hour.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from datagen.driving.weather_formats import FORMS, Rows, is_on_earth, read_rows
from datagen.driving.weather_record import (
    HOURS,
    MONTHS,
    OPTIONAL,
    RADIATION,
    REQUIRED,
    SPELLING,
    HourlyRecord,
    sun_over,
    sunlit_middles,
)
from shared.errors import WeatherError
from shared.logs import logger
from shared.variables import ZERO_CELSIUS

_log = logger(__name__)

BRIDGED = 12
"""Hours in a row up to which infrared radiation is put in. Without the column the sky's temperature is worked out from
dew point and cover, some kelvin away for the whole year."""
FAR = 3.5
"""Clocks are no further from the sun than this [h]: the west of China is 3 h off. A file of such a place whose clock is
Greenwich's is in UTC."""

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
_LEAP_DAY = slice(59 * 24, 60 * 24)


def read_hourly(path: Path) -> HourlyRecord:
    """Read a weather file, in whichever form its content is.

    Raises WeatherError if the file is missing, is in none of the forms, is not of one year of hours, or lacks values.
    """
    if not path.exists():
        raise WeatherError(f"{path}: no such weather file; expected {FORMS}")
    rows = read_rows(path)
    _check_place(path, rows)
    return _completed(path, rows, *_in_order(path, rows))


def _check_place(path: Path, rows: Rows) -> None:
    place, local = rows.place, rows.local_offset
    if not is_on_earth(place):
        said = ", ".join(f"{name} {place[name]:g}" for name in ("latitude", "longitude", "time zone", "altitude"))
        raise WeatherError(
            f"{path}: place is {said}; expected degrees north, degrees east, hours east of Greenwich, and metres above"
            " the sea"
        )
    if local is not None and abs(local) > 14:
        raise WeatherError(f"{path}: local time zone is {local:g} h; expected hours east of Greenwich, -14 to 14")


# ---------------------------------------------------------------- rows in their hours


def _in_order(path: Path, rows: Rows) -> tuple[dict[str, np.ndarray], float, float]:
    """Columns in the order of the record, its time zone, and by how much the sun is later [h].

    Raises WeatherError if the stamps are not the hours of one year in order from 1 January.
    """
    count = len(rows.lines)
    if count not in (HOURS, HOURS + 24):
        per = count / HOURS
        hint = f", {60 / per:g} min apart: keep or average to one row an hour" if per in (2, 4, 6, 12, 60) else ""
        raise WeatherError(
            f"{path}: found {count} hourly rows{hint}; expected {HOURS} (or {HOURS + 24} of a leap year), one year of"
            " hours from 1 January"
        )
    stamps = _hours_of_year(rows, leap=count > HOURS)
    ends = np.floor(stamps) if rows.means == "start" else np.ceil(stamps) - 1.0
    wrong = np.flatnonzero(~(np.mod(ends - ends[0] - np.arange(count), count) == 0))
    first = 0 if not np.isfinite(ends[0]) or ends[0] not in (-1.0, 0.0) else (int(wrong[0]) if wrong.size else None)
    if first is not None:
        raise WeatherError(_out_of_order(path, rows, first, count))
    shift, offset = _to_local(path, rows)
    instant = float(stamps[0]) + rows.beam_later
    ahead = int(np.floor(instant) - ends[0]) if rows.means == "instant" else 0
    later = instant - float(np.floor(instant)) - 0.5 if rows.means == "instant" else 0.0
    columns = {
        name: np.roll(values, int(ends[0]) + shift + (ahead if name in RADIATION else 0))
        for name, values in rows.columns.items()
    }
    if count > HOURS:
        columns = {name: np.delete(values, _LEAP_DAY) for name, values in columns.items()}
        _log.warning("%s: has %d hourly rows, of a leap year: 29 February is left out", path, count)
    return columns, offset, round(later, 6)


def _hours_of_year(rows: Rows, *, leap: bool) -> np.ndarray:
    """Hours since the year began by a file's stamps, shape (n,); NaN where there is no such date."""
    days = np.concatenate([[0], np.cumsum(MONTHS + (np.arange(12) == 1) * leap)])
    valid = (rows.month >= 1) & (rows.month <= 12) & (rows.day >= 1) & (rows.day <= 31)
    valid &= (rows.hour >= 0) & (rows.hour <= 24)
    month = np.where(valid, rows.month, 1).astype(np.intp)
    return np.where(valid, 24.0 * (days[month - 1] + rows.day - 1) + rows.hour, np.nan)


def _out_of_order(path: Path, rows: Rows, row: int, count: int) -> str:
    found = f"{rows.month[row]:g}/{rows.day[row]:g} {rows.hour[row]:g} h"
    since = f"the hour after that of line {rows.lines[row - 1]}" if row else "the first hour of 1 January"
    return (
        f"{path}: line {rows.lines[row]} is of {found} (month/day, hour); expected {since}: the rows of {rows.form} are"
        f" the {count} hours of one year in order, each once, so sort them, fill gaps, and delete doubles"
    )


def _to_local(path: Path, rows: Rows) -> tuple[int, float]:
    """By how many rows the hours of local standard time are later than the stamps, and its offset [h]."""
    offset, longitude = rows.place["time zone"], rows.place["longitude"]
    solar = float(round(longitude / 15.0))
    local = rows.local_offset
    if local is None:
        local = solar if offset == 0 and abs(longitude / 15.0) > FAR else offset
    elif np.isnan(local):
        local = solar
    shift = round(local - offset)
    if shift:
        _log.warning(
            "%s: its stamps are of UTC%+g and its place at longitude %g: its rows are moved to UTC%+g, which is taken"
            " for local standard time",
            *(path, offset, longitude, offset + shift),
        )
    return shift, offset + shift


# ---------------------------------------------------------------- columns that may be used


def _completed(path: Path, rows: Rows, columns: dict[str, np.ndarray], offset: float, later: float) -> HourlyRecord:
    """The record, with what can be worked out of other columns where a file has no such column, or an empty one."""
    import pvlib  # a second, which a description that is refused need not wait for

    columns = {name: values for name, values in columns.items() if not np.isnan(values).all()}
    if "pressure" not in columns:
        standard = float(pvlib.atmosphere.alt2pres(rows.place["altitude"]))
        columns["pressure"] = np.full(HOURS, standard)
        _log.warning("%s: has no pressure: that of the standard atmosphere is taken, %.0f Pa", path, standard)
    if "temp_dew" not in columns and {"humidity", "temp_air"} <= columns.keys():
        humidity = np.where((columns["humidity"] > 0) & (columns["humidity"] <= 110), columns["humidity"], np.nan)
        celsius = pvlib.atmosphere.tdew_from_rh(columns["temp_air"] - ZERO_CELSIUS, np.minimum(humidity, 100.0))
        columns["temp_dew"] = np.asarray(celsius) + ZERO_CELSIUS
    missing = [name for name in ("ghi", "dhi") if name not in columns]
    names = [name for name in (*REQUIRED, *OPTIONAL) if name not in missing or len(missing) > 1]
    kept, absent = _checked(path, rows, columns, names)
    place = rows.place
    record = HourlyRecord(
        kept, place["latitude"], place["longitude"], place["altitude"], offset, absent=absent, sun_later=later
    )
    if len(missing) == 1:
        high = np.maximum(np.cos(np.radians(sun_over(sunlit_middles(record), record).zenith)), 0.0)
        beam = kept["dni"] * high
        kept[missing[0]] = kept["dhi"] + beam if missing == ["ghi"] else np.maximum(kept["ghi"] - beam, 0.0)
        _log.warning("%s: has no %s: it is worked out from the other two and the sun", path, SPELLING[missing[0]])
    return record


def _checked(
    path: Path, rows: Rows, columns: dict[str, np.ndarray], names: list[str]
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Columns without holes and impossible values, and why others are absent.

    Raises WeatherError if one of these is required.
    """
    kept: dict[str, np.ndarray] = {}
    absent: dict[str, str] = {}
    for name in names:
        trouble = "is not there"
        if name in columns:
            values = columns[name]
            low, high = _PLAUSIBLE[name]
            bad = np.flatnonzero(~((values >= low) & (values <= high)))
            if name == "infrared" and 0 < bad.size < HOURS:
                values = _bridged(path, values, bad)
                bad = np.flatnonzero(np.isnan(values))
            if not bad.size:
                kept[name] = np.ascontiguousarray(values)
                continue
            trouble = f"is missing or out of range in {bad.size} of {HOURS} hours, first in hour {bad[0] + 1}"
            trouble += f" ({values[bad[0]]:g}, expected {low:g} to {high:g} in SI)"
        if name in REQUIRED:
            advice = "fill it from the hours around it" if name in columns else "take a file that has it"
            raise WeatherError(
                f"{path}: {SPELLING[name]} {trouble}; expected a value in every hour of {rows.form}: {advice}"
            )
        absent[name] = f"{SPELLING[name]} {trouble}"
    return kept, absent


def _bridged(path: Path, values: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """Infrared radiation with its short gaps interpolated, over the year's end where one lies there.

    Where a gap is longer all of ``bad`` become NaN. A warning says which.
    """
    good = np.setdiff1d(np.arange(HOURS), bad)
    longest = int(np.diff(np.append(good, good[0] + HOURS)).max()) - 1
    short = longest <= BRIDGED
    _log.warning(
        "%s: %s is missing or out of range in %d of %d hours, first in hour %d, at most %d in a row: %s",
        *(path, SPELLING["infrared"], bad.size, HOURS, bad[0] + 1, longest),
        "it is interpolated" if short else "the sky's temperature is computed without it",
    )
    values = values.copy()
    values[bad] = np.interp(bad, good, values[good], period=HOURS) if short else np.nan
    return values
