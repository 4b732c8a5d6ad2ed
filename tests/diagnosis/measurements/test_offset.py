"""The offset that is found is the one that was put in, and it costs no night."""

import numpy as np
import pytest
import xarray as xr

from diagnosis.measurements.clock import make_clock
from diagnosis.measurements.mapping import Place
from diagnosis.measurements.plausible import find_offset
from diagnosis.measurements.signal import Signal
from diagnosis.measurements.weather import Daylight
from tests.diagnosis.measurements.house_cases import ZONE, measured

MARCH = 1_646_089_200.0
"""1 March 2022, 00:00 in Amsterdam [s since 1970]."""
PLACE = Place(latitude=52.0, longitude=5.0)


def sky(days=20, step=600.0, seed=1):
    """Times of the clock [s], an irradiance on the horizontal under passing clouds [W/m2], and the sun."""
    clock = make_clock("Europe/Amsterdam", ZONE, MARCH)
    time = clock.seconds(np.array([MARCH]))[0] + step * np.arange(days * 86400 / step)
    daylight = Daylight.over(time[0], time[-1], clock, PLACE)
    sine = np.maximum(np.cos(np.radians(daylight.zenith_at(time))), 0.0)
    clouds = np.random.default_rng(seed).uniform(0.2, 1.0, len(time))
    return time, 900.0 * sine * clouds, daylight


def read(time, values, kind="point"):
    end = np.append(time[1:], time[-1] + 600.0) if kind == "hold" else time
    return Signal(time, end, values, np.zeros(len(time), np.int8), kind, 3600.0, "W/m2")


@pytest.mark.parametrize("put_in", [23.4, -7.0])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_the_offset_is_the_one_put_in(put_in, noise):
    time, sun, daylight = sky()
    rng = np.random.default_rng(2)
    values = sun + put_in + noise * rng.standard_normal(len(time))
    values[rng.random(len(time)) < 0.05] = 0.0  # lost readings
    found = find_offset(read(time, values), daylight)
    assert len(found.values) == 21
    np.testing.assert_allclose(found.values, put_in, atol=0.5 * noise + 1e-9)
    np.testing.assert_allclose(found.taken_off(read(time, sun + put_in)).values, sun, atol=0.5 * noise + 1e-9)


@pytest.mark.parametrize("share", [1.0, 0.1])  # the latter as in an overcast winter
@pytest.mark.parametrize("late", [-12, 4])
def test_a_wrong_clock_is_no_offset(late, share):
    time, sun, daylight = sky()
    assert find_offset(read(time, share * np.roll(sun, 6 * late)), daylight) is None


def with_offset(frame, name, offset):
    return frame.assign(**{name: np.round(frame[name] + offset)})


def test_nights_with_an_offset_cost_no_hour_and_the_facade_is_as_without(house):
    frame, _ = measured()
    plain = house(frame.assign(sun=frame["sun"].round()), out="plain.nc")
    report = house(with_offset(frame, "sun", 41.0), out="offset.nc")
    assert [one.hours for one in report.stretches] == [one.hours for one in plain.stretches]
    assert report.stretches[0].measured == report.measured == 144.0
    (note,) = [one for one in report.notes if "offset" in one]
    assert note.startswith("column sun: stands at 41 W/m2 while the sun is down (median of 7 nights): ")
    doubts = [[one for one in it.notes if "while the sun is down: check" in one] for it in (plain, report)]
    assert doubts[0] == doubts[1] and not any("stuck" in one for one in report.notes)
    facades = [xr.load_dataset(one.recording)["sunshine"].values for one in (plain, report)]
    np.testing.assert_allclose(*facades, atol=1.0)
