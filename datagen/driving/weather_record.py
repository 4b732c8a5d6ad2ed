"""A year of weather as hourly numbers, and where the sun stands over it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from datagen.driving.transposition import SunPosition, sun_at, sunlit_middle
from shared.variables import ZERO_CELSIUS

HOURS = 8760
YEAR = 2001
"""The common year whose dates stand for the typical year (``shared.schema.EPOCH``)."""
MONTHS = np.array([31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31])
"""Days of its months."""

RADIATION = ("ghi", "dni", "dhi")
REQUIRED = ("temp_air", "wind_speed", "pressure", *RADIATION)
OPTIONAL = ("temp_dew", "wind_direction", "infrared", "opaque_cover")
SPELLING = {
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


@dataclass(frozen=True, eq=False)
class HourlyRecord:
    """What a weather file holds, in SI. Row h is the hour that ends at h + 1 o'clock local standard time.

    Attributes
    ----------
    columns
        Shape (8760,) each: temp_air, temp_dew [K], wind_speed [m/s], wind_direction [degree], pressure [Pa],
        ghi, dni, dhi (means of the hour), infrared [W/m2], opaque_cover [tenths].
    absent
        Columns that the file does not offer, and why.
    utc_offset
        Of local standard time [h].
    sun_later
        The sun of the radiation stands where it is so long after the middle of each hour [h]: not zero where a file
        holds radiation of instants.
    """

    columns: dict[str, np.ndarray]
    latitude: float
    longitude: float
    altitude: float
    utc_offset: float
    absent: dict[str, str] = field(default_factory=dict)
    sun_later: float = 0.0


def sunlit_middles(record: HourlyRecord, later: float = 0.0) -> pd.DatetimeIndex:
    """The middle of the sunlit part of each hour, shape (8760,); the middle of the hour where there is none.

    ``later`` is by how much the hours themselves are later than the record says [h].
    """
    zone = pd.Timedelta(hours=record.utc_offset - record.sun_later - later).to_pytimedelta()
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
