"""Sun on a plane, sky and clock against pvlib's own days and formulas worked by hand."""

from itertools import combinations

import numpy as np
import pandas as pd
import pvlib
import pytest

from diagnosis.measurements.clock import make_clock
from diagnosis.measurements.mapping import Place
from diagnosis.measurements.signal import Signal
from diagnosis.measurements.weather import Daylight, cloud_cover, global_of, on_the_plane, sky, sun_clock
from diagnosis.measurements.zones import find_zone
from shared.schema import COMPUTED
from shared.signals import Weather

PLACE = Place(latitude=52.5, longitude=6.1, altitude=5.0)
FIRST = pd.Timestamp("2022-04-30 23:00", tz="UTC")
CLOCK = make_clock("Europe/Amsterdam", find_zone("Europe/Amsterdam"), FIRST.timestamp())
HORIZONTAL = Weather(files=["x"], surface_tilt=0.0, surface_azimuth=180.0)
SOUTH = Weather(files=["x"], surface_tilt=90.0, surface_azimuth=180.0, albedo=0.2)


def clear_days(days=3, step=300, shift=0):
    """pvlib's clear sky and the sun every ``step`` seconds at the middles of the intervals."""
    times = pd.date_range(FIRST + pd.Timedelta(seconds=step / 2), periods=days * 86400 // step, freq=f"{step}s")
    times = times - pd.Timedelta(seconds=shift)
    sun = pvlib.solarposition.get_solarposition(times, PLACE.latitude, PLACE.longitude, altitude=PLACE.altitude)
    clear = pvlib.location.Location(PLACE.latitude, PLACE.longitude, altitude=PLACE.altitude).get_clearsky(
        times, model="ineichen", linke_turbidity=3.0
    )
    return clear, sun


def means(values, step):
    begin = float(CLOCK.seconds(np.array([FIRST.timestamp()]))[0]) + step * np.arange(len(values))
    flags = np.zeros(len(values), dtype=np.int8)
    return Signal(begin, begin + step, np.asarray(values, float), flags, "mean", 2.5 * step, "W/m2")


@pytest.mark.parametrize("step", [300, 3600])
def test_a_horizontal_plane_gets_what_was_measured(step):
    """Splitting and carrying conserve the energy, also over hours of sunrise and sunset."""
    clear, _ = clear_days()
    ghi = clear["ghi"].to_numpy().reshape(-1, step // 300).mean(axis=1)
    made = on_the_plane(means(ghi, step), CLOCK, PLACE, HORIZONTAL)
    np.testing.assert_allclose(made.values, ghi, atol=2.0, rtol=0.01)
    assert (made.flags == COMPUTED).all()


@pytest.mark.parametrize("step", [300, 3600])
def test_a_facade_on_clear_days(step):
    """From global irradiance alone, beside pvlib's transposition of the direct and diffuse parts that made it up."""
    clear, sun = clear_days()
    truth = pvlib.irradiance.get_total_irradiance(
        90, 180, sun["apparent_zenith"], sun["azimuth"], clear["dni"], clear["ghi"], clear["dhi"], albedo=0.2
    )["poa_global"].fillna(0)
    truth = truth.to_numpy().reshape(-1, step // 300).mean(axis=1)
    ghi = clear["ghi"].to_numpy().reshape(-1, step // 300).mean(axis=1)
    made = on_the_plane(means(ghi, step), CLOCK, PLACE, SOUTH).values
    assert made.mean() == pytest.approx(truth.mean(), rel=0.12)
    assert np.corrcoef(made, truth)[0, 1] > 0.99
    assert made[truth == 0].max() < 5.0


def air_of(kelvin, n=288):
    signal = means(np.full(n, kelvin), 300)
    return Signal(signal.begin, signal.end, signal.values, signal.flags, "mean", 750.0, "K")


def test_a_clear_sky_is_swinbanks():
    """Swinbank's law is also written T_sky = 0.0552 T_air^1.5."""
    _, sun = clear_days(days=1)
    ghi = np.maximum(910 * np.sin(np.radians(sun["apparent_elevation"].to_numpy())) - 30, 0)
    for kelvin in (270.0, 285.0, 300.0):
        made, how = sky(air_of(kelvin), {"ghi": means(ghi, 300)}, CLOCK, PLACE)
        np.testing.assert_allclose(made.values, 0.0552 * kelvin**1.5, atol=1.2)
        assert "Swinbank" in how and "Kasten" in how


def test_a_sky_with_dew_point_and_clouds_by_hand():
    """EnergyPlus' documentation of the same correlation, worked through for 290 K, dew point 280 K, 5 tenths."""
    dew = air_of(280.0)
    half = means(np.full(288, 0.5), 300)
    made, how = sky(air_of(290.0), {"temp_dew": dew, "opaque_cover": half}, CLOCK, None)
    emissivity = (0.787 + 0.764 * np.log(280.0 / 273.0)) * (1 + 0.112 - 0.0875 + 0.035)
    np.testing.assert_allclose(made.values, 290.0 * emissivity**0.25, rtol=1e-9)
    assert "Clark and Allen" in how and "measured cloud cover" in how


@pytest.mark.parametrize("late", [-60, 120])
def test_the_sun_tells_a_wrong_clock(late):
    clear, _ = clear_days(shift=late * 60)
    ghi = means(clear["ghi"], 300)
    found, correlation, down = sun_clock(ghi, Daylight.over(ghi.begin[0], ghi.end[-1], CLOCK, PLACE))
    assert abs(found - late) <= 5
    assert correlation > 0.98
    assert (down > 0.005) == (abs(late) >= 120)


def test_cloud_cover_comes_back():
    cover = 0.6
    _, sun = clear_days()
    sine = np.sin(np.radians(sun["apparent_elevation"].to_numpy()))
    ghi = np.maximum(910 * sine - 30, 0) * (1 - 0.75 * cover**3.4)
    noons, found = cloud_cover(means(ghi, 300), CLOCK, PLACE)
    assert len(noons) == 3 and (noons % 86400 == 43200).all()
    np.testing.assert_allclose(found, cover, atol=0.03)


# Tuples, not sets: the tests are named after them, and workers that collect tests must agree on the names.
COMBINATIONS = [some for count in (2, 3) for some in combinations(("ghi", "dni", "dhi"), count)]


def broken_clouds(step):
    """Three days whose beam is between none and all of a clear sky's, unlike Erbs' mean sky: parts, and on a facade."""
    clear, sun = clear_days()
    rng = np.random.default_rng(2)
    through = np.repeat(rng.choice([0.0, 0.4, 1.0], len(clear) // 12), 12)
    sine = np.maximum(np.cos(np.radians(sun["apparent_zenith"].to_numpy())), 0.0)
    dni, dhi = clear["dni"].to_numpy() * through, clear["dhi"].to_numpy() * (1.5 - 0.5 * through)
    ghi = dni * sine + dhi
    facade = pvlib.irradiance.get_total_irradiance(
        90, 180, sun["apparent_zenith"], sun["azimuth"], dni, ghi, dhi, albedo=0.2, model=SOUTH.transposition,
        dni_extra=pvlib.irradiance.get_extra_radiation(sun.index),
        airmass=pvlib.atmosphere.get_relative_airmass(sun["apparent_zenith"]),
    )["poa_global"].fillna(0)  # fmt: skip
    parts = {"ghi": ghi, "dni": dni, "dhi": dhi}
    return {k: one.reshape(-1, step // 300).mean(axis=1) for k, one in parts.items()}, facade.to_numpy().reshape(
        -1, step // 300
    ).mean(axis=1)


def carried(parts, names, plane, step):
    """On the plane from those of the parts that are named."""
    signals = {name: means(parts[name], step) for name in names}
    if "ghi" in names:
        ghi = signals.pop("ghi")
    else:
        ghi = global_of(signals["dhi"], signals["dni"].values, signals["dhi"].values, CLOCK, PLACE)
    return on_the_plane(ghi, CLOCK, PLACE, plane, **{name: one.values for name, one in signals.items()}).values


@pytest.mark.parametrize("names", COMBINATIONS, ids="-".join)
def test_a_facade_gets_what_was_measured_of_the_sun(names):
    """Erbs' mean sky misses these hours by a tenth and more of their mean; measured parts do not."""
    step = 3600
    parts, truth = broken_clouds(step)
    erbs = np.sqrt(np.mean((carried(parts, {"ghi"}, SOUTH, step) - truth) ** 2))
    found = np.sqrt(np.mean((carried(parts, names, SOUTH, step) - truth) ** 2))
    assert erbs > 0.1 * truth.mean()
    assert found < 0.25 * erbs
    assert carried(parts, names, SOUTH, step).mean() == pytest.approx(truth.mean(), rel=0.02)
