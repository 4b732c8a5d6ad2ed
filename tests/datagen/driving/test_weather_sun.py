"""Radiation that is not of the place or the clock that its file says, in a real year."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pvlib
import pytest

from datagen.driving.weather_files import read_hourly
from datagen.driving.weather_sun import check_sun, sun_over, sunlit_middles
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
    assert not caplog.records


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda r: replace(r, utc_offset=-r.utc_offset), r"(87|33)% of the global .* falls while the sun is down"),
        (lambda r: replace(r, utc_offset=0.0), r"(28|66)% of the global .* while the sun is down .* time zone \+0 h"),
        (lambda r: replace(r, longitude=-r.longitude), r"longitude (79\.95|160\.5).* hours of local standard time"),
        (lambda r: replace(r, latitude=-r.latitude), r"W/m2 with the sun of the other hemisphere; expected degrees"),
        (lambda r: moved(r, -1), r"W/m2 with the sun 1 h later; expected"),
        (lambda r: moved(r, 3), r"W/m2 with the sun 3 h earlier; expected"),
    ],
    ids=["time zone's sign", "UTC", "longitude's sign", "latitude's sign", "an hour early", "three late"],
)
def test_a_clock_or_a_place_that_is_not_the_radiation_s_is_refused(real, change, sentence):
    with pytest.raises(WeatherError, match=rf"^w\.epw: .*{sentence}"):
        check_sun(Path("w.epw"), change(real))


def test_instants_in_place_of_means_are_told(real, caplog):
    """The sun of the end of each hour: global is made to be the others' there."""
    ends = sun_over(sunlit_middles(real, 0.5), real).zenith
    ghi = real.columns["dhi"] + real.columns["dni"] * np.maximum(np.cos(np.radians(ends)), 0)
    with caplog.at_level("WARNING", logger="zeroshot"):
        check_sun(Path("w.epw"), replace(real, columns=real.columns | {"ghi": np.minimum(ghi, 1600)}))
    assert "with the sun half an hour later, as of instants" in caplog.text


def test_a_year_without_sun_has_no_clock(real):
    check_sun(Path("w.epw"), replace(real, columns=real.columns | {name: np.zeros(8760) for name in SUN}))
