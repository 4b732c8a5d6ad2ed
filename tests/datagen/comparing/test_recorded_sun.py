"""The sun of recorded weather: means and instants, against geometry and the weather's own irradiance."""

import numpy as np
import pandas as pd
import pvlib
import pytest

from datagen.comparing.recorded_sun import Sun
from datagen.driving.transposition import irradiance_on_plane
from shared.errors import RecordingError
from shared.signals import Weather
from tests.datagen.places import GREENSBORO


def test_irradiance_at_instants_follows_the_geometry():
    """Direct light only, no ground: the cosine of incidence on a south wall, from the sun's vector."""
    plane = Weather(files=["x.csv"], surface_tilt=90.0, surface_azimuth=180.0, albedo=0.0, transposition="isotropic")
    time = 86400.0 * 79 + 3600.0 * np.arange(24)
    zero, beam = np.zeros(24), np.full(24, 800.0)
    place = {"latitude": 41.98, "longitude": -87.92, "altitude": 200.0, "utc_offset": -6.0}
    found = irradiance_on_plane(plane, time, beam, zero, zero, **place)
    clock = pd.date_range("2001-03-21", periods=24, freq="h", tz="Etc/GMT+6")
    sun = pvlib.solarposition.get_solarposition(clock, 41.98, -87.92, altitude=200.0)
    height, azimuth = np.radians(sun["apparent_elevation"]), np.radians(sun["azimuth"])
    cosine = np.where(height > 0, np.maximum(np.cos(height) * np.cos(azimuth - np.pi), 0), 0)
    np.testing.assert_allclose(found, 800.0 * cosine, atol=0.5)
    assert found.argmax() == 12


def sun_of(place, method):
    return Sun(input="HFac", dni="dni", dhi="dhi", ghi="ghi", method=method, **place)


def test_means_and_instants_are_not_taken_for_each_other(file_rows):
    time, means, place = file_rows
    instants = [0.5 * (one + np.roll(one, -1)) for one in means]  # as weather readers interpolate a file's means
    plane = Weather(files=[GREENSBORO])
    sun_of(place, "mean").signal(plane, time, *means)
    sun_of(place, "point").signal(plane, time, *instants)
    with pytest.raises(
        RecordingError, match=r"'point', but .* are means since the row before.* expected method = 'mean'"
    ):
        sun_of(place, "point").signal(plane, time, *means)
    with pytest.raises(RecordingError, match=r"'mean', but .* are instants.* expected method = 'point'"):
        sun_of(place, "mean").signal(plane, time, *instants)
    still = [np.zeros_like(time)] * 3  # a night says nothing
    assert not sun_of(place, "point").signal(plane, time, *still).values.any()
