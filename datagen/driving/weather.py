"""The weather of a place as input signals: hourly instants of a periodic year, with the sun on a given plane.

Weather files hold the radiation as hourly means and the rest as hourly readings. Simulation wants one signal that
is continuous in time. Here every quantity is given at the hours and is a straight line between them: that IS the
input signal, so that a recording of hourly instants reproduces the input exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

import numpy as np

from datagen.driving.tables import Piecewise
from datagen.driving.transposition import transposed
from datagen.driving.weather_files import read_hourly
from datagen.driving.weather_record import HOURS, HourlyRecord, sun_over, sunlit_middles
from datagen.driving.weather_sun import check_still, check_sun
from shared.errors import WeatherError
from shared.signals import Weather

UNITS: Mapping[str, str] = MappingProxyType(
    {
        "temp_air": "K",
        "temp_dew": "K",
        "temp_sky": "K",
        "wind_speed": "m/s",
        "wind_direction": "degree",
        "pressure": "Pa",
        "ghi": "W/m2",
        "dni": "W/m2",
        "dhi": "W/m2",
        "poa_global": "W/m2",
    }
)
"""Every column that a weather table can offer, by pvlib's name, and its unit."""

STEFAN_BOLTZMANN = 5.670374419e-8
_HOUR = 3600.0


@dataclass(frozen=True, eq=False)
class WeatherTable:
    """A periodic year of weather.

    Attributes
    ----------
    columns
        Values at t = 0, 1, ..., 8760 h after 1 January 00:00 local standard time, shape (8761,) each, in
        :data:`UNITS`. The last repeats the first. Read-only.
    absent
        Columns that the file cannot offer, and why.
    """

    source: str
    columns: Mapping[str, np.ndarray]
    absent: Mapping[str, str]
    latitude: float
    longitude: float
    altitude: float
    utc_offset: float

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column that is there."""
        return {name: UNITS[name] for name in self.columns}

    def values(self, column: str) -> np.ndarray:
        """One column, shape (8761,).

        Raises WeatherError if the file does not offer it.
        """
        if column in self.columns:
            return self.columns[column]
        if column in self.absent:
            raise WeatherError(f"{self.source}: offers no {column}: {self.absent[column]}")
        raise WeatherError(f"{self.source}: {column!r} is not a weather column; expected one of {', '.join(UNITS)}")

    def signal(self, column: str, start: float, stop: float) -> Piecewise:
        """A column as a linear signal with hourly knots that cover ``start`` to ``stop`` [s since time zero].

        The year repeats, so that any span of time has weather, also before time zero. A wind direction goes on beyond 0
        or 360 degree instead of sweeping over the whole compass; whole turns depend on the start. Raises WeatherError
        if the file does not offer the column.
        """
        hours = np.arange(np.floor(start / _HOUR), np.ceil(stop / _HOUR) + 1)
        values = self.values(column)[np.mod(hours, HOURS).astype(np.intp)]
        if column == "wind_direction":
            values = np.unwrap(values, period=360.0)
        return Piecewise(hours * _HOUR, values)


def read_weather(spec: Weather, file: str, base: Path) -> WeatherTable:
    """Read one weather file and transpose the sun to the plane of ``spec``; kept in memory once read.

    ``file`` is one of ``spec.files``: a path relative to ``base``, the description's folder, or ``pvlib:NAME`` for one
    that pvlib ships. Raises WeatherError if the file is missing, is not a weather file, lacks values, or cannot be
    true: by its sun, or by columns that stand still.
    """
    path = weather_path(file, base)
    try:
        stamp = path.stat().st_mtime_ns
    except OSError:
        stamp = 0  # the reader says what is wrong
    return _read(path, stamp, spec.surface_tilt, spec.surface_azimuth, spec.albedo, spec.transposition)


def weather_path(file: str, base: Path) -> Path:
    """Where a weather file of a system description lies."""
    if file.startswith("pvlib:"):
        package = find_spec("pvlib")  # where it lies, without the second that its import takes
        assert package is not None and package.origin is not None
        return Path(package.origin).parent / "data" / file.removeprefix("pvlib:")
    return (base / file).resolve()


@lru_cache(maxsize=128)
def _read(path: Path, stamp: int, tilt: float, azimuth: float, albedo: float, model: str) -> WeatherTable:
    """``stamp`` is part of the key, so that a file that changed is read again."""
    record = read_hourly(path)
    check_sun(path, record)
    record = check_still(path, record)
    raw = record.columns
    columns = {name: _ended(raw[name]) for name in ("temp_air", "wind_speed", "pressure")}
    columns |= {name: _ended(raw[name]) for name in ("temp_dew", "wind_direction") if name in raw}
    columns |= {name: instants(raw[name]) for name in ("ghi", "dni", "dhi")}
    columns["poa_global"] = instants(_plane_of_array(record, tilt, azimuth, albedo, model))
    absent = {name: why for name, why in record.absent.items() if name in UNITS}
    if "infrared" in raw or {"temp_dew", "opaque_cover"} <= raw.keys():
        columns["temp_sky"] = _ended(sky_temperature(raw))
    else:
        reasons = [record.absent[name] for name in ("infrared", "temp_dew", "opaque_cover") if name in record.absent]
        wanted = "infrared, or dew point and sky cover, as an EPW file of the place has them"
        absent["temp_sky"] = f"{'; '.join(reasons)}; expected {wanted}"
    for values in columns.values():
        values.flags.writeable = False
    return WeatherTable(
        str(path),
        MappingProxyType(columns),
        MappingProxyType(absent),
        record.latitude,
        record.longitude,
        record.altitude,
        record.utc_offset,
    )


def _ended(values: np.ndarray) -> np.ndarray:
    """Readings at the ends of the hours -> values at 0 .. 8760 h, (8760,) -> (8761,): time 0 is the year's end."""
    return np.concatenate([values[-1:], values])


def instants(means: np.ndarray) -> np.ndarray:
    """Hourly means -> values at 0 .. 8760 h, (8760,) -> (8761,): each the mean of the two hours that meet there.

    Straight lines between them conserve the year's total, since every hourly mean enters two instants by a half.
    An hour's own mean becomes (previous + 2 own + next) / 4 of the file's means.
    """
    values = 0.5 * (means + np.roll(means, 1))
    return np.concatenate([values, values[:1]])


def sky_temperature(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Black-body temperature of the sky [K], shape (hours,).

    From the horizontal infrared radiation where there is one; else from dry bulb, dew point and opaque sky cover
    by the correlation with which EPW files fill their infrared column (Clark and Allen 1978, "The estimation of
    atmospheric radiation for clear and cloudy skies"), and :func:`cloud_factor`:

        emissivity = (0.787 + 0.764 ln(T_dew / 273)) cloud_factor
    """
    if "infrared" in columns:
        return (columns["infrared"] / STEFAN_BOLTZMANN) ** 0.25
    dew = np.minimum(columns["temp_dew"], columns["temp_air"])
    clear = 0.787 + 0.764 * np.log(dew / 273.0)
    emissivity = np.minimum(clear * cloud_factor(columns["opaque_cover"]), 1.0)
    return emissivity**0.25 * columns["temp_air"]


def cloud_factor(tenths: np.ndarray) -> np.ndarray:
    """What clouds multiply a clear sky's emissivity by, from their cover N [tenths], same shape.

    1 + 0.0224 N - 0.0035 N^2 + 0.00028 N^3 (Walton 1983, NBSIR 83-2655).
    """
    return 1.0 + 0.0224 * tenths - 0.0035 * tenths**2 + 0.00028 * tenths**3


def _plane_of_array(record: HourlyRecord, tilt: float, azimuth: float, albedo: float, model: str) -> np.ndarray:
    """Mean global irradiance of each hour on the plane [W/m2], shape (8760,).

    The sun stands where it is in the middle of the hour, or of the hour's sunlit part at sunrise and sunset.
    """
    raw = record.columns
    times = sunlit_middles(record)
    sun = sun_over(times, record)
    parts = (raw["dni"], raw["dhi"], raw["ghi"])
    return transposed(times.day_of_year.to_numpy(), sun, *parts, tilt=tilt, azimuth=azimuth, albedo=albedo, model=model)
