"""Irradiance on a plane, from the direct normal, diffuse and global horizontal irradiance and where the sun stands.

For hourly means of weather files :mod:`datagen.driving.weather` says where it stands; :func:`irradiance_on_plane` is
for the sun of the very times that are given.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from shared.schema import EPOCH
from shared.signals import Weather


def irradiance_on_plane(
    plane: Weather,
    time: np.ndarray,
    dni: np.ndarray,
    dhi: np.ndarray,
    ghi: np.ndarray,
    *,
    latitude: float,
    longitude: float,
    altitude: float,
    utc_offset: float,
) -> np.ndarray:
    """Global irradiance on the plane of ``plane`` [W/m2], shape (n,), by pvlib's transposition of its choice.

    ``time`` [s since time zero, local standard time] and ``dni``, ``dhi``, ``ghi`` [W/m2] are (n,); ``utc_offset`` is
    that of local standard time [h].
    """
    times = dates_of(time, utc_offset)
    sun = sun_at(times, latitude=latitude, longitude=longitude, altitude=altitude)
    return transposed(
        times.day_of_year.to_numpy(),
        sun,
        *(dni, dhi, ghi),
        tilt=plane.surface_tilt,
        azimuth=plane.surface_azimuth,
        albedo=plane.albedo,
        model=plane.transposition,
    )


@dataclass(frozen=True, eq=False)
class SunPosition:
    """Where the sun stands, shape (n,) each [degree]: ``zenith`` with the air's refraction, ``azimuth`` from north."""

    zenith: np.ndarray
    azimuth: np.ndarray


def dates_of(time: np.ndarray, utc_offset: float) -> pd.DatetimeIndex:
    """Dates of times (n,) [s since time zero, local standard time that is ``utc_offset`` h from UTC]."""
    seconds = pd.to_timedelta(np.asarray(time, dtype=np.float64) - 3600.0 * utc_offset, unit="s")
    return pd.DatetimeIndex(pd.Timestamp(EPOCH, tz="UTC") + seconds)


def sun_at(
    times: pd.DatetimeIndex,
    *,
    latitude: float,
    longitude: float,
    altitude: float,
    pressure: float | None = None,
    temperature: float = 12.0,
) -> SunPosition:
    """Where the sun stands at n times.

    ``pressure`` and ``temperature`` are of the air [Pa, degC], which bends the light at the horizon: if not given, that
    of the standard atmosphere at the altitude, and pvlib's.
    """
    import pvlib  # a second, which a description that is refused need not wait for

    found = pvlib.solarposition.get_solarposition(
        times, latitude, longitude, altitude=altitude, pressure=pressure, temperature=temperature
    )
    return SunPosition(found["apparent_zenith"].to_numpy(), found["azimuth"].to_numpy())


def sunlit_middle(height: np.ndarray) -> np.ndarray:
    """Where in each of n spans the middle of its sunlit part is, shape (n,), as a share of the span.

    One half where the sun is up all the time, or never. ``height`` is the sun's above the horizon at the spans' edges,
    shape (n + 1,) [degree].
    """
    before, after = height[:-1], height[1:]
    rising, setting = (before <= 0) & (after > 0), (before > 0) & (after <= 0)
    # share at which the sun crosses the horizon; its height is nearly a straight line over an hour
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.where(rising | setting, before / (before - after), 0.0)
    return np.where(rising, 0.5 * (1 + crossing), np.where(setting, 0.5 * crossing, 0.5))


def transposed(
    day: np.ndarray,
    sun: SunPosition,
    dni: np.ndarray,
    dhi: np.ndarray,
    ghi: np.ndarray,
    *,
    tilt: float,
    azimuth: float,
    albedo: float,
    model: str,
) -> np.ndarray:
    """Global irradiance on a plane [W/m2], shape (n,), by a ``model`` of transposition that pvlib knows.

    ``day`` of the year and ``dni``, ``dhi``, ``ghi`` [W/m2] are (n,), and ``sun`` is where it then stands; ``tilt`` and
    ``azimuth`` are the plane's [degree].
    """
    import pvlib

    parts = pvlib.irradiance.get_total_irradiance(
        tilt,
        azimuth,
        sun.zenith,
        sun.azimuth,
        dni,
        ghi,
        dhi,
        dni_extra=pvlib.irradiance.get_extra_radiation(day),
        airmass=pvlib.atmosphere.get_relative_airmass(sun.zenith),
        albedo=albedo,
        model=model,
    )
    values = np.asarray(parts["poa_global"], dtype=np.float64)
    up = np.cos(np.radians(tilt))
    # no air mass below the horizon: what little diffuse light there is comes from the whole sky
    dusk = dhi * (1 + up) / 2 + ghi * albedo * (1 - up) / 2
    return np.maximum(np.where(np.isfinite(values) & (sun.zenith < 90.0), values, dusk), 0.0)
