"""The hour that autumn repeats, in logs with rows of several sensors: as it was, or refused."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.clock import read_stamps
from diagnosis.measurements.mapping import Time

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


@settings(max_examples=200)
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


@settings(max_examples=60)
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
