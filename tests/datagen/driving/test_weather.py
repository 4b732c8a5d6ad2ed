"""Weather as input signals, against numbers that do not come from the code under test.

The year is the real one that pvlib ships (Greensboro, 36.1 N, 79.95 W, UTC-5); the literals were read off its file.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pvlib
import pytest

from datagen.driving.weather import UNITS, instants, read_weather, sky_temperature
from shared.signals import Weather

FILE = "pvlib:723170TYA.CSV"
LATITUDE, LONGITUDE, ZONE = 36.1, -79.95, -5.0
YEAR = 8760 * 3600.0


def read(**plane):
    return read_weather(Weather(files=[FILE], **plane), FILE, Path())


@pytest.fixture(scope="module")
def raw():
    """The file's own columns, read as plain CSV."""
    return pd.read_csv(Path(pvlib.__file__).parent / "data" / "723170TYA.CSV", skiprows=1)


def textbook_sun(clock_hour):
    """Cosines between the sun and up, south and west, after the Astronomical Almanac's low-precision formulas.

    They hold the sun's place to 0.01 degree, without refraction. ``clock_hour`` counts from 1 January 2001, the
    year that stands for the typical one; noon of 1 January 2000 is where the formulas count from.
    """
    days = 365.5 + (clock_hour - ZONE) / 24
    mean_longitude = 280.460 + 0.9856474 * days
    anomaly = np.radians(357.528 + 0.9856003 * days)
    ecliptic = np.radians(mean_longitude + 1.915 * np.sin(anomaly) + 0.020 * np.sin(2 * anomaly))
    obliquity = np.radians(23.439)
    declination = np.arcsin(np.sin(obliquity) * np.sin(ecliptic))
    ascension = np.degrees(np.arctan2(np.cos(obliquity) * np.sin(ecliptic), np.cos(ecliptic)))
    # the equation of time is mean longitude less right ascension
    angle = np.radians(15 * (clock_hour - ZONE - 12) + LONGITUDE + mean_longitude - ascension)
    phi = np.radians(LATITUDE)
    up = np.cos(phi) * np.cos(declination) * np.cos(angle) + np.sin(phi) * np.sin(declination)
    south = -np.sin(declination) * np.cos(phi) + np.cos(declination) * np.sin(phi) * np.cos(angle)
    return up, south, np.cos(declination) * np.sin(angle)


def isotropic(dni, ghi, dhi, cos_incidence, tilt, albedo):
    ground = albedo * ghi * (1 - np.cos(tilt)) / 2
    return dni * np.maximum(cos_incidence, 0) + dhi * (1 + np.cos(tilt)) / 2 + ground


def test_facade_irradiance_by_hand_at_noon_of_a_clear_day():
    # 16 January: hours 11-12 and 12-13 have DNI 957, 963, GHI 557, 586, DHI 61, 63 W/m2. At 11:30 and 12:30 the
    # sun stands 31.3 and 33.1 degree high, and its beam meets the south wall with cosines 0.8194 and 0.8379:
    #   957 * 0.8194 + 61 / 2 + 0.2 * 557 / 2 = 870.4;  963 * 0.8379 + 63 / 2 + 0.2 * 586 / 2 = 897.0
    up, south, _ = textbook_sun(np.array([15 * 24 + 11.5, 15 * 24 + 12.5]))
    np.testing.assert_allclose(np.degrees(np.arcsin(up)), [31.3, 33.1], atol=0.1)
    np.testing.assert_allclose(south, [0.8194, 0.8379], atol=5e-5)
    at_noon = read(transposition="isotropic").values("poa_global")[15 * 24 + 12]
    # 0.03 degree of refraction and of the formulas' error
    assert at_noon == pytest.approx((870.4 + 897.0) / 2, rel=0.0005)


def test_perez_by_hand_at_noon_of_a_clear_day():
    # Perez et al. 1990, Solar Energy 44(5), table 6, clearness above 6.2; extraterrestrial 1414 W/m2 in mid-January
    f = np.array([0.678, -0.327, -0.250, 0.156, -1.377, 0.251])
    expected = []
    for hour, dni, ghi, dhi in ((11.5, 957, 557, 61), (12.5, 963, 586, 63)):
        (cos_zenith, cos_south, _), beta = textbook_sun(np.array(15 * 24 + hour)), np.pi / 2
        zenith = np.arccos(cos_zenith)
        clearness = ((dhi + dni) / dhi + 1.041 * zenith**3) / (1 + 1.041 * zenith**3)
        assert clearness > 6.2
        air_mass = 1 / (cos_zenith + 0.50572 * (96.07995 - np.degrees(zenith)) ** -1.6364)
        brightness = dhi * air_mass / 1414
        f1 = f[0] + f[1] * brightness + f[2] * zenith
        f2 = f[3] + f[4] * brightness + f[5] * zenith
        sky = dhi * ((1 - f1) * (1 + np.cos(beta)) / 2 + f1 * cos_south / cos_zenith + f2 * np.sin(beta))
        expected.append(dni * cos_south + sky + 0.2 * ghi / 2)
    at_noon = read().values("poa_global")[15 * 24 + 12]
    assert at_noon == pytest.approx(np.mean(expected), rel=0.002)
    assert at_noon == pytest.approx(927.9, abs=0.1)  # the very number that datasets of this default hold


@pytest.mark.parametrize(("tilt", "azimuth"), [(90.0, 270.0), (35.0, 180.0)])
def test_plane_irradiance_over_the_year_against_the_textbook(raw, tilt, azimuth):
    zenith, south, west = textbook_sun(np.arange(8760) + 0.5)
    beta = np.radians(tilt)
    wall = south if azimuth == 180.0 else west
    incidence = zenith * np.cos(beta) + wall * np.sin(beta)
    dni, ghi, dhi = (raw[f"{name} (W/m^2)"].to_numpy(float) for name in ("DNI", "GHI", "DHI"))
    means = np.where(zenith > 0, isotropic(dni, ghi, dhi, incidence, beta, 0.2), 0)
    expected = 0.5 * (means + np.roll(means, 1))
    got = read(surface_tilt=tilt, surface_azimuth=azimuth, transposition="isotropic").values("poa_global")[:-1]
    high = (zenith > 0.1) & (np.roll(zenith, 1) > 0.1)  # the sun 6 degrees up in both hours
    assert high.sum() > 3500
    np.testing.assert_allclose(got[high], expected[high], rtol=0.001, atol=0.5)
    assert got.sum() == pytest.approx(expected.sum(), rel=0.005)


def test_units_and_readings_of_the_file(raw):
    table = read()
    assert set(table.columns) == set(UNITS)
    assert table.units["temp_sky"] == "K"
    assert not table.absent
    # 1 January 13:00: 11.7 degC, dew point 10.6 degC, 992 mbar, 5.2 m/s from 250 degree
    assert table.values("temp_air")[13] == pytest.approx(284.85)
    assert table.values("temp_dew")[13] == pytest.approx(283.75)
    assert table.values("pressure")[13] == pytest.approx(99200)
    assert table.values("wind_speed")[13] == 5.2
    assert table.values("wind_direction")[13] == 250
    # 1 January, hours 12-13 and 13-14
    assert table.values("ghi")[13] == pytest.approx(raw["GHI (W/m^2)"][12:14].mean())
    assert (table.latitude, table.longitude, table.utc_offset) == (LATITUDE, LONGITUDE, ZONE)
    for name in UNITS:
        assert table.values(name).shape == (8761,)
        assert table.values(name)[0] == table.values(name)[-1]
        assert np.isfinite(table.values(name)).all()


def test_radiation_is_conserved(raw):
    table = read()
    for name in ("ghi", "dni", "dhi"):
        hourly = raw[f"{name.upper()} (W/m^2)"].to_numpy(float)
        lines = np.trapezoid(table.values(name), dx=1.0)
        assert lines == pytest.approx(hourly.sum(), rel=1e-12)
        means = 0.5 * (table.values(name)[:-1] + table.values(name)[1:])
        np.testing.assert_allclose(means, (np.roll(hourly, 1) + 2 * hourly + np.roll(hourly, -1)) / 4)
    np.testing.assert_allclose(instants(np.array([0.0, 4.0, 2.0])), [1.0, 2.0, 3.0, 1.0])
    assert (table.values("poa_global") >= 0).all()
    # the nights are dark: at most the neighbouring hour reaches in
    lit = (raw["GHI (W/m^2)"] + raw["DNI (W/m^2)"] + raw["DHI (W/m^2)"] > 0).to_numpy()
    dark = ~lit & ~np.roll(lit, 1)
    assert dark.sum() > 3500
    assert (table.values("poa_global")[:-1][dark] == 0).all()


def test_sky_temperature_by_hand():
    # clear, 20 degC, dew point 10 degC: 0.787 + 0.764 ln(283.15 / 273) = 0.8149; 293.15 * 0.8149^(1/4) = 278.53 K
    clear = {"temp_air": np.array([293.15]), "temp_dew": np.array([283.15]), "opaque_cover": np.array([0.0])}
    assert sky_temperature(clear)[0] == pytest.approx(278.53, abs=0.01)
    # overcast: 1 + 0.224 - 0.35 + 0.28 = 1.154, emissivity 0.9404, 288.68 K
    assert sky_temperature(clear | {"opaque_cover": np.array([10.0])})[0] == pytest.approx(288.68, abs=0.01)
    # half covered: 1 + 0.112 - 0.0875 + 0.035 = 1.0595, emissivity 0.8634, 282.58 K
    assert sky_temperature(clear | {"opaque_cover": np.array([5.0])})[0] == pytest.approx(282.58, abs=0.01)
    # an infrared reading goes first: 300 W/m2 are (300 / 5.67e-8)^(1/4) = 269.70 K
    assert sky_temperature(clear | {"infrared": np.array([300.0])})[0] == pytest.approx(269.70, abs=0.01)
    table = read()
    below = table.values("temp_air") - table.values("temp_sky")
    assert below.min() >= 0
    assert 5 < below.mean() < 20


def test_signal_repeats_every_year():
    table = read()
    span = 3 * 86400.0
    for name in ("temp_air", "poa_global"):
        here = table.signal(name, 0, span)
        for years in (-1, 1, 7):
            there = table.signal(name, years * YEAR, years * YEAR + span)
            np.testing.assert_array_equal(here.values, there.values)
            np.testing.assert_array_equal(here.times + years * YEAR, there.times)
    across = table.signal("temp_air", -7200, 7200)
    np.testing.assert_array_equal(across.times, [-7200, -3600, 0, 3600, 7200])
    hours = table.values("temp_air")
    np.testing.assert_array_equal(across.values, [hours[8758], hours[8759], hours[8760], hours[1], hours[2]])


def test_wind_direction_turns_the_short_way():
    signal = read().signal("wind_direction", 0, YEAR)
    assert np.abs(np.diff(signal.values)).max() <= 180
    np.testing.assert_allclose(np.mod(signal.values, 360), np.mod(read().values("wind_direction"), 360), atol=1e-9)
