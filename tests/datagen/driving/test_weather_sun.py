"""Radiation that is not of its place or its clock or contradicts itself, and columns that rest, in a real year."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pvlib
import pytest

from datagen.driving.weather_files import read_hourly
from datagen.driving.weather_sun import check_still, check_sun
from shared.errors import WeatherError

DATA = Path(pvlib.__file__).parent / "data"
SUN = ("ghi", "dni", "dhi")


@pytest.fixture(scope="module", params=["723170TYA.CSV", "703165TY.csv"])
def real(request):
    """A year of North Carolina, and one of Alaska."""
    return read_hourly(DATA / request.param)


def moved(record, hours):
    """The same with its radiation in later rows."""
    return replace(record, columns=record.columns | {name: np.roll(record.columns[name], hours) for name in SUN})


def test_a_real_year_passes_without_a_word(real, caplog):
    with caplog.at_level("WARNING", logger="zeroshot"):
        check_sun(Path("w.epw"), real)
        kept = check_still(Path("w.epw"), real)
    assert not caplog.records
    assert kept.columns.keys() == real.columns.keys()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda r: replace(r, utc_offset=-r.utc_offset), r"(87|33)% of the global .* falls while the sun is down"),
        (lambda r: replace(r, utc_offset=0.0), r"(28|66)% of the global .* while the sun is down .* time zone \+0 h"),
        (lambda r: moved(r, -1), r"W/m2 with the sun 1 h later; expected"),
        (lambda r: moved(r, 3), r"W/m2 with the sun 3 h earlier; expected"),
    ],
    ids=["time zone's sign", "UTC", "an hour early", "three late"],
)
def test_a_clock_that_is_not_the_radiation_s_is_refused(real, change, sentence):
    with pytest.raises(WeatherError, match=rf"^w\.epw: .*{sentence}"):
        check_sun(Path("w.epw"), change(real))


@pytest.fixture(scope="module")
def greensboro():
    return read_hourly(DATA / "723170TYA.CSV")


@pytest.mark.parametrize(
    ("axis", "sentence"),
    [
        ("longitude", r"longitude 79\.95.* hours of local standard time"),
        ("latitude", r"W/m2 with the sun of the other hemisphere; expected degrees"),
    ],
)
def test_a_place_whose_sign_is_wrong_is_refused(greensboro, axis, sentence):
    with pytest.raises(WeatherError, match=rf"^w\.epw: .*{sentence}"):
        check_sun(Path("w.epw"), replace(greensboro, **{axis: -getattr(greensboro, axis)}))


def changed(record, hours=slice(None), **columns):
    """The same with other values, or times a factor where a function is given, in some hours."""
    values = {name: record.columns[name].copy() for name in columns}
    for name, change in columns.items():
        values[name][hours] = change(values[name][hours]) if callable(change) else change
    return replace(record, columns=record.columns | values)


JUNE = slice(151 * 24, 181 * 24)


@pytest.mark.parametrize(
    ("columns", "hours", "sentence"),
    [
        ({"ghi": 0.0, "dni": 0.0, "dhi": 0.0}, slice(None), r"are zero all year; expected a year with sun"),
        (
            {"dni": 0.0, "dhi": 0.0},
            slice(None),
            r"by 100% in month 1, .*; all zero in it: direct normal radiation, diffuse .*; expected",
        ),
        ({"dni": 0.0}, JUNE, r"by \d\d% in month 6, .*; all zero in it: direct normal radiation"),
        # all three times 1.25 less 1 of the global one are 20 % of what the file then says
        ({"ghi": lambda v: 1.25 * v}, slice(None), r"differ by 20% in month"),
    ],
    ids=["no sun", "global alone", "no beam in June", "global a quarter more"],
)
def test_radiation_that_contradicts_itself_is_refused_whatever_the_clock(greensboro, columns, hours, sentence):
    with pytest.raises(WeatherError, match=rf"^w\.epw: .*{sentence}"):
        check_sun(Path("w.epw"), changed(greensboro, hours, **columns))


@pytest.mark.parametrize(
    ("column", "value", "length", "outcome"),
    [
        ("temp_air", 281.35, 40, "dry-bulb temperature is 281.35 K for 40 h from hour 1001"),
        ("temp_air", 281.35, 80, WeatherError),
        ("wind_speed", 0.0, 200, "wind speed is 0 m/s for 200 h from hour 1001"),
        ("wind_speed", 0.0, 400, WeatherError),
        ("ghi", 123.0, 80, WeatherError),
        ("temp_dew", 272.35, 80, "as no weather does: the column is not used"),
    ],
)
def test_a_column_that_rests_longer_than_the_weather_can(greensboro, caplog, column, value, length, outcome):
    broken = changed(greensboro, slice(1000, 1000 + length), **{column: value})
    if outcome is WeatherError:
        with pytest.raises(WeatherError, match=r"^w\.epw: .* h from hour \d+ \(day .*; expected at most \d+ h"):
            check_still(Path("w.epw"), broken)
        return
    kept = check_still(Path("w.epw"), broken)
    assert outcome in caplog.text
    assert (column in kept.columns) == ("not used" not in outcome)
    assert (column in kept.absent) == ("not used" in outcome)
