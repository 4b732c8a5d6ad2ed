"""The hour that autumn repeats, in logs with rows of several sensors: as it was, or refused."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.clock import read_stamps
from diagnosis.measurements.mapping import Time
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import HOURLY, measured

ZONE = ZoneInfo("Europe/Amsterdam")
BACK = datetime(2022, 10, 30, 1, 0, tzinfo=UTC)
"""When 03:00 becomes 02:00."""


def on_the_wall(times):
    return [one.astimezone(ZONE).replace(tzinfo=None).isoformat(sep=" ") for one in times]


def understood(texts, sensors):
    """UTC of rows that hold readings of ``sensors``, one letter each, and the sentences."""
    read = np.array([[one in row for one in "ABC"] for row in sensors])
    found = read_stamps(pd.Series(texts), Time(column="t", zone="Europe/Amsterdam"), "file", lambda: read)
    return found.utc, found.notes


def by_hand(rows, every=60):
    """Rows as 'HH:MM sensors', after a day of both: minutes after 02:00 of the first pass, and the sentences."""
    first = BACK - timedelta(hours=1)
    before = on_the_wall(first + timedelta(minutes=m) for m in range(-26 * 60, 0, every))
    after = on_the_wall(BACK + timedelta(minutes=m) for m in range(60, 240, every))
    texts = [*before, *(f"2022-10-30 {one[:5]}:00" for one in rows), *after]
    utc, notes = understood(texts, [*["AB"] * len(before), *(one[6:] for one in rows), *["AB"] * len(after)])
    return ((utc[len(before) : -len(after)] - first.timestamp()) / 60).tolist(), notes


@pytest.mark.parametrize(
    ("rows", "minutes"),
    [
        (["02:00 A", "02:00 B", "02:00 A", "02:00 B"], [0, 0, 60, 60]),
        (["02:00 A", "02:00 B", "02:00 B", "02:00 A"], [0, 0, 60, 60]),
        (["02:00 AB", "02:00 AB"], [0, 60]),
        (["02:00 A", "02:30 B", "02:00 B"], [0, 30, 60]),
        # hourly, a little later the second time: nothing goes back
        (["02:00 AB", "02:01 AB"], [0, 61]),
        (["02:00 A", "02:01 B", "02:02 A", "02:03 B"], [0, 1, 62, 63]),
    ],
)
def test_which_pass_a_row_of_an_hourly_log_is_of(rows, minutes):
    assert by_hand(rows)[0] == minutes


@pytest.mark.parametrize(
    ("rows", "minutes"),
    [
        (["02:00 A", "02:00 B", "02:30 A", "02:30 B", "02:00 A", "02:00 B"], [0, 0, 30, 30, 60, 60]),
        (["02:00 AB", "02:30 AB", "02:30 AB"], [0, 30, 90]),
        # every row is written twice
        (["02:00 AB", "02:00 AB", "02:30 AB", "02:30 AB", "02:00 AB", "02:00 AB"], [0, 0, 30, 30, 60, 60]),
    ],
)
def test_which_pass_a_row_of_a_closer_log_is_of(rows, minutes):
    assert by_hand(rows, every=30)[0] == minutes


@pytest.mark.parametrize(
    "rows",
    [
        ["02:00 A", "02:00 A", "02:00 B", "02:00 B"],
        ["02:00 AB", "02:00 AB", "02:30 AB", "02:30 AB"],
        ["02:00 A", "02:00 B", "02:00 A", "02:00 B", "02:00 A"],
    ],
)
def test_rows_whose_order_does_not_tell_are_refused(rows):
    said = r"row \d+ \(2022-10-30 02:.0:00\) has a reading of what row \d+ has one of, .* expected rows in the order"
    with pytest.raises(RecordingError, match=said):
        by_hand(rows)


def test_an_hour_that_is_there_once_is_said_to_be():
    minutes, notes = by_hand(["02:00 A", "02:00 B"])
    assert "there once only" in notes[0] and "2 stamps" in notes[1] and "0 of them" in notes[1]
    assert np.isnan(minutes).all() and "2 of them are left out, because nothing tells" in notes[1]
    assert np.isnan(by_hand(["02:00 A", "02:00 B", "02:30 A", "02:30 B"], every=30)[0]).all()


@settings(max_examples=200, deadline=None)
@given(
    every=st.sampled_from([1, 5, 15, 20, 30, 60, 120, 180]),
    after=st.integers(0, 179),
    begin=st.integers(-150, 120),
    length=st.integers(0, 240),
)
def test_one_outage_over_the_change_puts_no_row_an_hour_wrong(every, after, begin, length):
    """Rows whose pass nothing tells are left out, and none of a log that lost nothing."""
    first = BACK - timedelta(minutes=2 * 24 * 60 + after % every)
    times = [first + timedelta(minutes=m) for m in range(0, 4 * 24 * 60, every)]
    gone = (BACK + timedelta(minutes=begin), BACK + timedelta(minutes=begin + length))
    times = [one for one in times if not gone[0] <= one < gone[1]]
    utc, _ = understood(on_the_wall(times), ["A"] * len(times))
    known = np.isfinite(utc)
    np.testing.assert_array_equal(utc[known], np.array([one.timestamp() for one in times])[known])
    assert known.all() or (every <= 60 and length > 0)
    assert (~known).sum() * every <= 60


@pytest.mark.parametrize("pass_", [0, 1])
def test_an_hourly_log_that_lost_one_pass_has_no_reading_in_the_other(house, pass_):
    """Held against the same log with offsets in its stamps."""
    frame, hours = measured(minutes=60)
    whole = HOURLY.replace("persons = 2.0\n", "persons = 2.0\nfill = 0.0\n")
    kept = frame[hours != 50 + pass_].copy()  # the log begins at midnight of the 28th, by the clock
    told = pd.to_datetime(kept["when"]).dt.tz_localize(ZONE, ambiguous=np.full(len(kept), pass_ == 1)).astype(str)
    aware = xr.load_dataset(house(kept.assign(when=told), whole, out="aware.nc").recording)["warmth"].values
    naive = xr.load_dataset(house(kept, whole, out="naive.nc").recording)["warmth"].values
    both = np.isfinite(naive)
    np.testing.assert_array_equal(naive[both], aware[both])
    assert np.isfinite(aware).sum() - both.sum() == 1


def test_changes_are_not_lost_for_the_hour_that_they_may_be_off():
    """A valve that closes in that night stays closed."""
    times = [BACK + timedelta(minutes=m) for m in (-1700, -1250, -1100, -630, -320, -45, 400, 700, 1300)]
    utc, notes = understood(on_the_wall(times), ["A"] * len(times))
    np.testing.assert_array_equal(utc, [one.timestamp() for one in times])
    assert "0 of them, from where the clock goes back, are taken for its second pass" in notes[-1]


@settings(max_examples=60, deadline=None)
@given(
    every=st.lists(st.sampled_from([10, 15, 30, 45, 60, 90]), min_size=1, max_size=3),
    late=st.lists(st.sampled_from([0, 0, 20, 300]), min_size=3, max_size=3),
    before=st.integers(2 * 60, 30 * 60),
)
def test_a_row_for_each_sensor_comes_back_as_it_was(every, late, before):
    """Sensors that are read at their own intervals, some a little later than the others."""
    rows = []
    for sensor, minutes, seconds in zip("ABC", every, late, strict=False):
        first = BACK - timedelta(minutes=before)
        rows += [(first + timedelta(minutes=m, seconds=seconds), sensor) for m in range(0, before + 24 * 60, minutes)]
    rows.sort()
    utc, _ = understood(on_the_wall([time for time, _ in rows]), [sensor for _, sensor in rows])
    np.testing.assert_array_equal(utc, [time.timestamp() for time, _ in rows])


@pytest.mark.parametrize("pass_", [0, 1])
def test_a_log_that_begins_in_the_hour(pass_):
    """In either pass: what follows without a gap tells."""
    times = [BACK + timedelta(minutes=m) for m in range(30 - 60 * (1 - pass_), 300, 15)]
    utc, _ = understood(on_the_wall(times), ["A"] * len(times))
    np.testing.assert_array_equal(utc, [one.timestamp() for one in times])


def test_an_hourly_log_with_a_row_for_each_sensor_is_that_of_whole_rows(house):
    frame, _ = measured(minutes=60)
    whole = xr.load_dataset(house(frame, HOURLY, out="whole.nc").recording)
    half = [name for name in frame.columns if name != "when"][::2]
    apart = pd.concat([frame.drop(columns=half), frame[["when", *half]]]).sort_index(kind="stable")
    xr.testing.assert_equal(xr.load_dataset(house(apart, HOURLY, out="apart.nc").recording), whole)
    with pytest.raises(RecordingError, match="does not tell its two passes apart"):
        house(apart.sort_values(["when", "room"], kind="stable"), out="sorted.nc")
