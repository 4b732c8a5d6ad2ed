"""The hour that autumn repeats, in logs with rows of several sensors: as it was, or refused."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.importing.clock import read_stamps
from diagnosis.importing.mapping import Time
from shared.errors import RecordingError
from tests.diagnosis.importing.house_cases import HOURLY, measured

ZONE = ZoneInfo("Europe/Amsterdam")
BACK = datetime(2022, 10, 30, 1, 0, tzinfo=UTC)
"""When 03:00 becomes 02:00."""


def on_the_wall(times):
    return [one.astimezone(ZONE).replace(tzinfo=None).isoformat(sep=" ") for one in times]


def understood(texts, sensors):
    """UTC of rows that hold readings of ``sensors``, one letter each, and the sentences."""
    read = np.array([[one in row for one in "ABC"] for row in sensors])
    return read_stamps(pd.Series(texts), Time(column="t", zone="Europe/Amsterdam"), "file", lambda: read)


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
        (["02:00 A", "02:00 B"], [0, 0]),
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
        (["02:00 A", "02:00 B", "02:30 A", "02:30 B"], [0, 0, 30, 30]),
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
    _, notes = by_hand(["02:00 A", "02:00 B"])
    assert "there once only" in notes[0] and "2 stamps" in notes[1] and "0 of them" in notes[1]


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
