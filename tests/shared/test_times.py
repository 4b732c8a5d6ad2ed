"""The time of recordings, against dates that are written out here."""

from datetime import date, timedelta

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from shared.errors import RecordingError
from shared.netcdf import read_netcdf
from shared.times import recorded_begins, recorded_times, time_zero

DAY = 86400.0
SINCE_2001 = 7701 * DAY
"""1 February 2022 after 1 January 2001: 21 years, 5 leap days and January."""


OFFSETS = (" 00:00:00+01:00", "T00Z", " 00:00:00 -5")


def written(path, time, units, start=None, start_units="s"):
    values = {} if start is None else {"start": (("system",), np.asarray(start, float), {"units": start_units})}
    attrs = {} if units is None else {"units": units}
    xr.Dataset(values, {"time": ("time", np.asarray(time, float), attrs)}).to_netcdf(path)
    return read_netcdf(path, RecordingError, "a recording", times=True)


@pytest.mark.parametrize(
    ("time", "units"),
    [
        ([3600.0, 7200.0], "seconds since 2022-02-01 00:00:00"),
        ([1.0, 2.0], "hours since 2022-02-01"),
        ([0.0, 60.0], "minutes since 2022-02-01 01:00:00"),
        ([31 + 1 / 24, 31 + 2 / 24], "days since 2022-01-01 00:00"),
    ],
)
def test_dates_in_any_units_are_seconds_since_time_zero(tmp_path, time, units):
    found = recorded_times(tmp_path, written(tmp_path / "one.nc", time, units))
    np.testing.assert_allclose(found, [SINCE_2001 + 3600, SINCE_2001 + 7200], rtol=0, atol=1e-3)


@pytest.mark.parametrize(("start", "units"), [(5 * DAY, "s"), (5, "days since 2001-01-01 00:00:00")])
def test_elapsed_time_has_its_beginning_apart(tmp_path, start, units):
    recording = written(tmp_path / "one.nc", [60.0, 120.0], "s", [start, start], units)
    assert recorded_times(tmp_path, recording).tolist() == [60.0, 120.0]
    assert recorded_begins(tmp_path, recording, 2).tolist() == [5 * DAY, 5 * DAY]
    assert recorded_begins(tmp_path, recording.drop_vars("start"), 3).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("units", "sentence"),
    [
        (None, "r.nc: time has no units; expected for example 'seconds since 2001-01-01 00:00:00'"),
        ("min", "time is in 'min', which are not dates of the standard calendar"),
        *(
            (f"hours since 2022-02-01{more}", "expected local standard time, .* without an offset from UTC")
            for more in OFFSETS
        ),
        ("s", "time is in 's', which are not dates"),
    ],
)
def test_other_times_are_refused_in_a_sentence(tmp_path, units, sentence):
    recording = written(tmp_path / "one.nc", [1.0, 2.0], units)
    with pytest.raises(RecordingError, match=sentence):
        recorded_times(tmp_path / "r.nc", recording)


@pytest.mark.parametrize(
    ("start", "units", "found"),
    [
        (9.96921e36, "s", r"9\.96921e\+36 s since time zero \(2001-01-01 00:00:00\)"),
        (-101 * 366 * DAY, "s", r"-3\.19\d*e\+09 s since time zero \(2001-01-01 00:00:00\)"),
        (73050, "days since 2001-01-01 00:00:00", "2201-01-03T00:00:00"),
    ],
)
def test_a_start_that_was_never_written_is_refused(tmp_path, start, units, found):
    """NetCDF has 9.97e36 there: dates of it had been too large to be told."""
    recording = written(tmp_path / "one.nc", [60.0, 120.0], "s", [5, start], units)
    with pytest.raises(RecordingError, match=rf"r\.nc: start is {found}; expected a time in the years 1900 to 2200"):
        recorded_begins(tmp_path / "r.nc", recording, 2)
    for last in (-100 * 365 * DAY, 199 * 365 * DAY):
        near = written(tmp_path / "near.nc", [60.0, 120.0], "s", [5 * DAY, last])
        assert recorded_begins(tmp_path / "r.nc", near, 2).tolist() == [5 * DAY, last]


def with_bounds(folder, bounds):
    time = ("time", [3600.0, 7200.0], {"units": "seconds since 2022-02-01", "bounds": "time_bnds"})
    xr.Dataset({"time_bnds": (("time", "bnds"), bounds)}, {"time": time}).to_netcdf(folder / "b.nc")
    return read_netcdf(folder / "b.nc", RecordingError, "a recording", times=True)


def test_a_time_that_is_not_the_end_of_its_bounds_is_refused(tmp_path):
    recording = with_bounds(tmp_path, [[0.0, 3600.0], [3600.0, 7200.0]])
    assert recorded_times(tmp_path, recording)[0] == SINCE_2001 + 3600
    for begin in (1800.0, 3600.0):  # labelled in the middle, and at the start
        recording = with_bounds(tmp_path, [[begin, begin + 3600.0], [begin + 3600.0, begin + 7200.0]])
        with pytest.raises(RecordingError, match="time is not the end of the steps in time_bnds"):
            recorded_times(tmp_path / "r.nc", recording)


@given(st.dates(date(1990, 1, 1), date(2090, 12, 31)))
def test_time_zero_is_a_monday_near_new_year(day):
    zero = time_zero(day)
    assert zero.weekday() == 0
    assert abs(zero - date(day.year, 1, 1)) <= timedelta(days=3)
