"""Irradiance on a plane at instants, from the direct normal, diffuse and global horizontal irradiance at them.

Weather files hold hourly means and are treated in :mod:`datagen.weather`; this is for signals that are instants.
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
    seconds = pd.to_timedelta(np.asarray(time, dtype=np.float64) - 3600.0 * utc_offset, unit="s")
    times = pd.DatetimeIndex(pd.Timestamp(EPOCH, tz="UTC") + seconds)
    sun = pvlib.solarposition.get_solarposition(times, latitude, longitude, altitude=altitude)
    zenith = sun["apparent_zenith"].to_numpy()
    parts = pvlib.irradiance.get_total_irradiance(
        plane.surface_tilt,
        plane.surface_azimuth,
        zenith,
        sun["azimuth"].to_numpy(),
        dni,
        ghi,
        dhi,
        dni_extra=pvlib.irradiance.get_extra_radiation(times.day_of_year.to_numpy()),
        airmass=pvlib.atmosphere.get_relative_airmass(zenith),
        albedo=plane.albedo,
        model=plane.transposition,
    )
    values = np.asarray(parts["poa_global"], dtype=np.float64)
    tilt = np.cos(np.radians(plane.surface_tilt))
    # no air mass below the horizon: what little diffuse light there is comes from the whole sky
    dusk = dhi * (1 + tilt) / 2 + ghi * plane.albedo * (1 - tilt) / 2
    return np.maximum(np.where(np.isfinite(values) & (zenith < 90.0), values, dusk), 0.0)
