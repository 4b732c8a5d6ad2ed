"""Whether a weather file's radiation fits its place and its clock: the sun has to be up when it shines.

A time zone or longitude of the wrong sign, rows in local time under a header in UTC, or rows named by the hour's start
change no single value, and put another sun on a facade. Two figures tell them: the share of the radiation that falls
while the sun is down, and how well global irradiance is diffuse plus the horizontal part of direct irradiance.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from datagen.driving.transposition import SunPosition, sun_at, sunlit_middle
from datagen.driving.weather_files import HOURS, YEAR, HourlyRecord
from shared.errors import WeatherError
from shared.logs import logger
from shared.variables import ZERO_CELSIUS

_log = logger(__name__)

DOWN = 92.0
"""Zenith [degree] from which the sun counts as down."""
IN_THE_DARK = 0.25
"""Share of the radiation that falls while the sun is down from which a file is refused, whatever else it holds."""
OTHERWISE = 0.5
"""Another clock or place that leaves less than this share of the misfit is taken for the right one."""
LEAST = 10.0
"""A misfit up to this says nothing [W/m2]."""
SHIFTS = (*range(-6, 0), *range(1, 7))
"""Hours by which rows may be misnamed while most of the radiation is still of daylight."""


def check_sun(path: Path, record: HourlyRecord) -> None:
    """Hold a file's radiation against where the sun stands by its place and its rows.

    Of instants in place of means, half an hour off, it warns.

    Raises
    ------
    WeatherError
        If much of the radiation falls while the sun is down, or if global, direct and diffuse irradiance agree far
        better with the sun of another clock, by an hour or more, or of the other hemisphere.
    """
    ghi = record.columns["ghi"]
    if not ghi.any():
        return
    place = f"latitude {record.latitude:g}, longitude {record.longitude:g}, time zone {record.utc_offset:+g} h"
    expected = (
        "expected degrees north, degrees east, hours east of Greenwich, and hours of local standard time that are named"
        " by their end"
    )
    dark = ghi[_sun_of_hours(record).zenith > DOWN].sum() / ghi.sum()
    if dark > IN_THE_DARK:
        raise WeatherError(
            f"{path}: {dark:.0%} of the global horizontal radiation falls while the sun is down at {place}; {expected}"
        )
    here = _misfit(record)
    if here <= LEAST:
        return
    others = {f"the sun {abs(h)} h {'later' if h > 0 else 'earlier'}": _misfit(record, h) for h in SHIFTS}
    others["the sun of the other hemisphere"] = _misfit(replace(record, latitude=-record.latitude))
    best = min(others, key=others.__getitem__)
    if others[best] < OTHERWISE * here:
        raise WeatherError(
            f"{path}: global horizontal radiation is diffuse and direct radiation's to {here:.0f} W/m2 rms with the sun"
            f" of {place}, and to {others[best]:.0f} W/m2 with {best}; {expected}"
        )
    half = min((0.5, -0.5), key=lambda h: _misfit(record, h))
    if (left := _misfit(record, half)) < OTHERWISE * here:
        _log.warning(
            "%s: global horizontal radiation is diffuse and direct radiation's to %.0f W/m2 rms with the sun in the"
            " middle of each hour, and to %.0f W/m2 with the sun half an hour %s, as of instants: they are taken for"
            " means of the hour, so that the sun stands half an hour off",
            *(path, here, left, "later" if half > 0 else "earlier"),
        )


def sunlit_middles(record: HourlyRecord, later: float = 0.0) -> pd.DatetimeIndex:
    """The middle of the sunlit part of each hour, shape (8760,); the middle of the hour where there is none.

    ``later`` is by how much the hours themselves are later than their rows say [h].
    """
    zone = pd.Timedelta(hours=record.utc_offset - later).to_pytimedelta()
    edges = pd.date_range(f"{YEAR}-01-01", periods=HOURS + 1, freq="h") - zone
    edges = edges.tz_localize("UTC")
    middle = sunlit_middle(90.0 - sun_over(edges, record).zenith)
    return edges[:-1] + pd.to_timedelta(middle, unit="h")


def sun_over(times: pd.DatetimeIndex, record: HourlyRecord) -> SunPosition:
    """Where the sun stands. Pressure and temperature only bend the light at the horizon: yearly means do."""
    return sun_at(
        times,
        latitude=record.latitude,
        longitude=record.longitude,
        altitude=record.altitude,
        pressure=float(record.columns["pressure"].mean()),
        temperature=float(record.columns["temp_air"].mean()) - ZERO_CELSIUS,
    )


def _sun_of_hours(record: HourlyRecord, later: float = 0.0) -> SunPosition:
    return sun_over(sunlit_middles(record, later), record)


def _misfit(record: HourlyRecord, later: float = 0.0) -> float:
    """Root mean square of global less diffuse less direct irradiance on the horizontal, where there is any [W/m2]."""
    ghi, dni, dhi = (record.columns[name] for name in ("ghi", "dni", "dhi"))
    height = np.maximum(np.cos(np.radians(_sun_of_hours(record, later).zenith)), 0.0)
    lit = (ghi > 0) | (dni > 0) | (dhi > 0)
    return float(np.sqrt(np.mean((ghi - dhi - dni * height)[lit] ** 2)))
