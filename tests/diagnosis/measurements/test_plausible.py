"""Readings that are something else than they are declared as."""

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pvlib
import pytest
import xarray as xr

from diagnosis.measurements.clock import make_clock
from diagnosis.measurements.mapping import Place
from diagnosis.measurements.plausible import about_dark, find_offset
from diagnosis.measurements.signal import Signal
from diagnosis.measurements.weather import Daylight
from diagnosis.measurements.zones import find_zone
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING, ZONE, measured

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


def told(report, words):
    return any(words in note for note in report.notes)


def test_what_is_as_declared_is_not_suspected(house):
    report = house(measured()[0])
    for words in (
        "register",
        "logged when it",
        "clear sky's",
        "the sun at longitude",
        "the town of zone",
        "irradiance is dark",
        "run by it",
    ):
        assert not told(report, words), report.notes


def test_a_register_is_told_from_a_power(house):
    frame, hours = measured()
    frame["kilowatts"] = np.where(hours == 50, 0.0, 1000.0 + 0.3 * hours)  # one reading was lost
    assert told(house(frame), "column kilowatts: hardly ever falls, from 1e+06 to")


def test_an_irradiance_in_another_unit_is_told(house):
    frame, _ = measured()
    assert told(house(frame.assign(sun=frame["sun"] / 1000)), "of a clear sky's in its best hours: check its unit")


def test_a_latitude_without_its_sign_is_told(house):
    frame, _ = measured()
    south = MAPPING.replace("latitude = 52.0", "latitude = -52.0")
    report = house(frame, south)
    assert told(report, "the town of zone Europe/Amsterdam lies at 52: check place.latitude (south is negative)")
    winter, _ = measured(first=datetime(2022, 11, 3, 23, 0, tzinfo=UTC))
    nameless = house(winter, south.replace("Europe/Amsterdam", "+01:00"), out="nameless.nc")
    assert told(nameless, "with the sun over 10 degrees high at latitude -52") and not told(nameless, "the town of")


@pytest.mark.parametrize("name", ["723170TYA.CSV", "703165TY.csv"])
def test_no_week_of_measured_weather_is_dark_by_day_unless_the_latitude_is_turned(name):
    path = Path(pvlib.__file__).parent / "data" / name
    data, meta = pvlib.iotools.read_tmy3(path, map_variables=True, coerce_year=2001)
    zone = f"{'-' if meta['TZ'] < 0 else '+'}{abs(int(meta['TZ'])):02d}:00"
    clock = make_clock(zone, find_zone(zone), datetime(2001, 1, 1, tzinfo=UTC).timestamp())
    begin = np.arange(len(data)) * 3600.0
    ghi, flags = data["ghi"].to_numpy(dtype=float), np.zeros(len(data), np.int8)
    weeks = [slice(k, k + 168) for k in range(0, 8736, 168)]
    made = [Signal(begin[k], begin[k] + 3600.0, ghi[k], flags[k], "mean", np.inf, "W/m2") for k in weeks]
    for sign, least, most in ((1, 0, 0), (-1, 10, 52)):
        place = Place(latitude=sign * meta["latitude"], longitude=meta["longitude"])
        assert least <= sum(about_dark(week, clock, place) is not None for week in made) <= most


def test_a_step_that_does_not_divide_a_day_is_told(house):
    odd = house(measured()[0], MAPPING.replace("[place]", "[grid]\nstep = 7000.0\n[place]"))
    assert told(odd, "grid.step is 7000 s, of which no whole number makes a day; expected one that does, such as the")


def test_a_heater_that_is_off_takes_no_power(house):
    frame, hours = measured()
    on = np.round(frame["kilowatts"], 3)
    numbers = house(frame.assign(kilowatts=np.where(hours % 24 < 6, 0.0, on)), out="numbers.nc")
    words = house(frame.assign(kilowatts=np.where(hours % 24 < 6, "OFF", on.astype(str))), out="words.nc")
    found = [xr.load_dataset(one.recording)["gas"].values for one in (numbers, words)]
    np.testing.assert_allclose(*found)
    assert told(words, f"column kilowatts: 'off' ({int((hours % 24 < 6).sum())} times) as 0 among its numbers")
    assert not told(numbers, "among its numbers")


def test_a_dark_noon_is_a_lost_reading(house):
    frame, hours = measured()
    noon = (hours == 13) | (hours == 37)
    assert not told(house(frame.assign(sun=np.where(noon, 0.0, frame["sun"]))), "irradiance is dark")


def test_an_output_of_which_nothing_is_left_is_told(house):
    gone = MAPPING.replace('"kW"\n', '"kW"\nshift = 1e9\n', 1)
    assert told(house(measured()[0], gone), "gas: kilowatts [kW] has no usable reading from 2022-")


def universal(frame):
    """The same rows with stamps in UTC."""
    stamps = pd.date_range("2022-10-27 22:00", periods=len(frame), freq=timedelta(minutes=10))
    return frame.assign(when=stamps.strftime("%Y-%m-%d %H:%M:%S"))


def test_another_zone_than_the_places_is_told(house):
    frame, _ = measured()
    far = house(frame, MAPPING.replace("longitude = 5.0", "longitude = -35.0"), out="far.nc")
    assert told(far, "ahead of the sun at longitude -35: check time.zone and place")
    for k, zone in enumerate(("UTC", "Etc/UTC", "Zulu")):
        utc = house(universal(frame), MAPPING.replace("Europe/Amsterdam", zone), out=f"utc-{k}.nc")
        assert told(utc, f"time.zone is {zone}: days, schedules and habits")


def test_a_sun_that_mostly_shines_by_night_is_refused(house, tmp_path):
    frame, _ = measured()
    antipodes = MAPPING.replace("longitude = 5.0", "longitude = -175.0")
    with pytest.raises(
        RecordingError,
        match=r"mapping.toml: weather: 100% of the irradiance comes while the sun is down at latitude 52, longitude"
        r" -175; expected most of it by day: .* \(standard time of Europe/Amsterdam is",
    ):
        house(frame, antipodes)
    assert not (tmp_path / "out").exists()
    # what is left in the months without a sun is an offset, and no reason
    polar = MAPPING.replace("latitude = 52.0", "latitude = 89.0")
    offset = house(frame.assign(sun=1.0 + 0.5 * np.sin(np.arange(len(frame)))), polar, out="polar.nc")
    assert told(offset, "100% of the irradiance comes while the sun is down")


def test_stamps_in_utc_of_a_place_that_has_a_zone(house):
    """The same recording as of stamps on the wall clock."""
    frame, _ = measured()
    wall = xr.load_dataset(house(frame, out="wall.nc").recording)
    report = house(universal(frame), MAPPING.replace("[place]", 'stamps = "UTC"\n[place]'), out="universal.nc")
    xr.testing.assert_equal(xr.load_dataset(report.recording), wall)
    assert report.zone == str(ZONE)


def test_what_is_left_out_as_impossible_is_told_with_its_limits(house):
    """A reading of a boiler's water in a column of the room."""
    frame, hours = measured()
    frame["room"] = np.where((hours > 40) & (hours < 41), 75.0, frame["room"])
    report = house(frame)
    count = int(((hours > 40) & (hours < 41)).sum())
    assert told(report, f"column room: {count} of {len(frame)} readings are left out: not -50 to 60 degC")
    assert told(report, "valid = [lowest, highest] says what else is possible")
    wider = MAPPING.replace("[variables.warmth]", "[variables.warmth]\nvalid = [-20, 90]")
    assert not told(house(frame, wider, out="wider.nc"), "column room: ")
    narrower = MAPPING.replace("[variables.warmth]", "[variables.warmth]\nvalid = [-20, 50]")
    assert told(house(frame, narrower, out="narrower.nc"), "readings are left out: not -20 to 50 degC")


OUTPUTS = (
    '{ name = "warmth", unit = "K", accuracy = 0.1, noise = { good = { sd = 0.05 }, poor = { sd = 0.2 } } },',
    '{ name = "gas", unit = "W", accuracy = 1.0, method = "mean", noise = { poor = { sd = 100.0 } } },',
)
EFFECTS = """
[[effects]]
name = "leak"
kind = "parameter"
description = "Air leaks in"
unit = "kg/s"
scale = 0.03
lower = 0.0
upper = 0.1
parameters = { "m0" = 1.0 }
"""


@pytest.fixture
def said(house, tmp_path):
    """Import with sensors and an effect declared; the findings that hold some words."""
    text = HOUSE.replace('{ name = "warmth", unit = "K", accuracy = 0.1 },', OUTPUTS[0])
    text = text.replace('{ name = "gas", unit = "W", accuracy = 1.0, method = "mean" },', OUTPUTS[1])
    (tmp_path / "declared.toml").write_text(text + EFFECTS)

    def run(frame, words, mapping=MAPPING, out="out/declared.nc"):
        found = house(frame, mapping, out=out, system=tmp_path / "declared.toml").physics
        return [one.text for one in found if words in one.text]

    return run


@pytest.mark.parametrize(
    ("words", "change", "mapping", "told"),
    [
        (
            "Is the unit right",  # kilowatts that are declared as watts move by less than the noise
            lambda d: d,
            MAPPING.replace('unit = "kW"', 'unit = "W"'),
            r"gas varies by 2 W in all, from .* which is less than its sensor's noise \(standard deviation 100 W\)\.",
        ),
        (
            "largest number",
            lambda d: d,
            MAPPING.replace('unit = "m3/h"', 'unit = "m3/s"'),
            r"air is usually 144 kg/s where it is not 0, and the largest number in kg/s that the description has is"
            r" 0\.1 \(upper of effect leak\)\. Is the unit right\?",
        ),
        (
            "swapped",
            lambda d: d.rename(columns={"room": "outside", "outside": "room"}),
            MAPPING,
            "warmth is 13.0 K colder on average than outdoors, the air outdoors, and varies more. Are their columns",
        ),
        (
            "degF",
            lambda d: d.assign(outside=d["outside"] * 1.8 + 32),
            MAPPING,
            r"outdoors, the air outdoors, has a median of 46.4 degC. Is its unit right \(degF\)\?",
        ),
    ],
)
def test_what_is_unlike_what_is_declared_is_told(said, words, change, mapping, told):
    frame, hours = measured()
    frame["valve"] = 50.0 + np.sin(hours)
    assert said(frame, words) == []
    (note,) = said(change(frame), words, mapping, "other.nc")
    assert re.match(told, note)
