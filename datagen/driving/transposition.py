"""Irradiance on a plane, from the direct normal, diffuse and global horizontal irradiance and where the sun stands.

For hourly means of weather files :mod:`datagen.driving.weather` says where it stands; :func:`irradiance_on_plane` is
for the sun of the very times that are given.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import pvlib

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

    Parameters
    ----------
    time
        Shape (n,) [s since time zero, local standard time].
    dni, dhi, ghi
        Shape (n,) each [W/m2].
    utc_offset
        Of local standard time [h].
    """
    times, sun = sun_at(time, latitude=latitude, longitude=longitude, altitude=altitude, utc_offset=utc_offset)
    return transposed(
        times,
        sun,
        *(dni, dhi, ghi),
        tilt=plane.surface_tilt,
        azimuth=plane.surface_azimuth,
        albedo=plane.albedo,
        model=plane.transposition,
    )


def sun_at(
    time: np.ndarray, *, latitude: float, longitude: float, altitude: float, utc_offset: float
) -> tuple[pd.DatetimeIndex, pd.DataFrame]:
    """Times (n,) [s since time zero, local standard time] as dates, and where the sun then stands [degree], n rows."""
    seconds = pd.to_timedelta(np.asarray(time, dtype=np.float64) - 3600.0 * utc_offset, unit="s")
    times = pd.DatetimeIndex(pd.Timestamp(EPOCH, tz="UTC") + seconds)
    return times, pvlib.solarposition.get_solarposition(times, latitude, longitude, altitude=altitude)


def sunlit_middle(height: np.ndarray) -> np.ndarray:
    """Where in each of n spans the middle of its sunlit part is, shape (n,), as a share of the span.

    One half where the sun is up all the time, or never.

    Parameters
    ----------
    height
        Of the sun above the horizon at the spans' edges, shape (n + 1,) [degree].
    """
    before, after = height[:-1], height[1:]
    rising, setting = (before <= 0) & (after > 0), (before > 0) & (after <= 0)
    # share at which the sun crosses the horizon; its height is nearly a straight line over an hour
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = np.where(rising | setting, before / (before - after), 0.0)
    return np.where(rising, 0.5 * (1 + crossing), np.where(setting, 0.5 * crossing, 0.5))


def transposed(
    times: pd.DatetimeIndex,
    sun: pd.DataFrame,
    dni: np.ndarray,
    dhi: np.ndarray,
    ghi: np.ndarray,
    *,
    tilt: float,
    azimuth: float,
    albedo: float,
    model: str,
) -> np.ndarray:
    """Global irradiance on a plane [W/m2], shape (n,), by pvlib's transposition.

    Parameters
    ----------
    times
        When, shape (n,).
    sun
        Where it then stands: ``apparent_zenith`` and ``azimuth`` [degree], n rows.
    dni, dhi, ghi
        Shape (n,) each [W/m2].
    tilt, azimuth
        Of the plane [degree].
    model
        A transposition that pvlib knows.
    """
    zenith = sun["apparent_zenith"].to_numpy()
    parts = pvlib.irradiance.get_total_irradiance(
        tilt,
        azimuth,
        zenith,
        sun["azimuth"].to_numpy(),
        dni,
        ghi,
        dhi,
        dni_extra=pvlib.irradiance.get_extra_radiation(times.day_of_year.to_numpy()),
        airmass=pvlib.atmosphere.get_relative_airmass(zenith),
        albedo=albedo,
        model=model,
    )
    values = np.asarray(parts["poa_global"], dtype=np.float64)
    up = np.cos(np.radians(tilt))
    # no air mass below the horizon: what little diffuse light there is comes from the whole sky
    dusk = dhi * (1 + up) / 2 + ghi * albedo * (1 - up) / 2
    return np.maximum(np.where(np.isfinite(values) & (zenith < 90.0), values, dusk), 0.0)
