"""Stamps become the building's own clock: both directions of daylight saving, offsets, and the calendar behind it."""

import re
from datetime import UTC, datetime, timedelta
from functools import cache
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.clock import formats_of, make_clock, read_stamps, runs_backwards, standard_offset
from diagnosis.measurements.mapping import Time
from diagnosis.measurements.zones import find_zone, latitude_of
from shared.errors import RecordingError

ZONES = ["Europe/Amsterdam", "America/New_York", "Australia/Sydney", "Australia/Lord_Howe", "Europe/Dublin", "UTC"]
AMSTERDAM = Time(column="t", zone="Europe/Amsterdam")


def stamps(texts, settings=AMSTERDAM):
    found = read_stamps(pd.Series(list(texts)), settings, "file")
    return found.utc, found.notes


@cache
def changes(zone, year):
    """UTC hours at which a zone's offset changes, by looking at every day of the year and at the hours of those."""

    def jumps(first, count, step):
        times = [first + step * k for k in range(count)]
        offsets = [t.astimezone(ZoneInfo(zone)).utcoffset() for t in times]
        return [times[k] for k in range(count - 1) if offsets[k] != offsets[k + 1]]

    hour, day = timedelta(hours=1), timedelta(days=1)
    days = jumps(datetime(year, 1, 1, tzinfo=UTC), 366, day)
    return [jumps(one, 25, hour)[0] + hour for one in days]


@settings(max_examples=25)
@given(
    zone=st.sampled_from(ZONES),
    year=st.integers(2008, 2030),
    which=st.integers(0, 1),
    before=st.integers(2 * 60, 30 * 60),
    step=st.sampled_from([5, 10, 15, 30]),
    offsets=st.booleans(),
)
def test_regular_times_survive_the_wall_clock(zone, year, which, before, step, offsets):
    """What a logger on the wall clock writes across a change of it comes back as the regular UTC times it was."""
    found = changes(zone, year)
    middle = found[which] if found else datetime(year, 6, 1, tzinfo=UTC)
    times = [middle + timedelta(minutes=m) for m in range(-before, 30 * 60, step)]
    wall = [t.astimezone(ZoneInfo(zone)) for t in times]
    texts = [t.isoformat() if offsets else t.replace(tzinfo=None).isoformat(sep=" ") for t in wall]
    utc, _ = stamps(texts, Time(column="t", zone=zone))
    np.testing.assert_array_equal(utc, [t.timestamp() for t in times])


def test_the_skipped_hour_is_no_gap_and_cannot_be_written():
    utc, _ = stamps(["2022-03-27 01:45", "2022-03-27 03:00", "2022-03-27 03:15"])
    np.testing.assert_array_equal(np.diff(utc), 900.0)
    with pytest.raises(RecordingError, match=r"2022-03-27 02:15:00 does not exist in Europe/Amsterdam.*'\+01:00'"):
        stamps(["2022-03-27 01:45", "2022-03-27 02:15"])
    utc, _ = stamps(["2022-03-27 01:45", "2022-03-27 02:15"], Time(column="t", zone="+01:00"))
    assert utc[1] == datetime(2022, 3, 27, 1, 15, tzinfo=UTC).timestamp()


@pytest.mark.parametrize(
    ("texts", "said"),
    [
        (["2022-05-01 00:00", "2022-05-01 02:00", "2022-05-01 01:00"], "runs backwards from row 2.*row 3"),
        (["2022-05-01 00:00+02:00", "2022-05-01 00:00+03:00"], "runs backwards"),
        (["2022-05-01 00:00+02:00", "2022-05-01 01:00"], "row 2 .* has no offset from UTC but others have"),
        (["2022-05-01 00:00", "01/05/2022 01:00"], "row 2 .'01/05/2022 01:00'. is not a time"),
        (["2022-05-01 00:00", ""], "row 2 has no time stamp"),
    ],
)
def test_stamps_that_cannot_be_understood(texts, said):
    with pytest.raises(RecordingError, match=said):
        stamps(texts)


def test_other_formats():
    utc, _ = stamps(["31/12/2021 23:00", "01/01/2022 00:00"], Time(column="t", zone="UTC", format="%d/%m/%Y %H:%M"))
    np.testing.assert_array_equal(utc, [1640991600.0, 1640995200.0])
    utc, _ = stamps(["1640991600", "1640991660.5"], Time(column="t", zone="UTC", format="unix"))
    np.testing.assert_array_equal(utc, [1640991600.0, 1640991660.5])
    utc, _ = stamps(["2021-12-31T23:00:00Z", "2022-01-01T01:00:00+01:00"])
    np.testing.assert_array_equal(np.diff(utc), 3600.0)


@pytest.mark.parametrize(
    ("form", "text", "utc"),
    [
        ("%H:%M %d-%m-%Y", "00:15 30-06-2022", "2022-06-29T22:15:00"),  # -2022 is a year, not an offset
        ("%H:%M %d-%m-%Y %z", "00:15 30-06-2022 +0000", "2022-06-30T00:15:00"),
        ("%d-%m-%Y %H:%M UTC", "30-06-2022 00:15 UTC", "2022-06-30T00:15:00"),
    ],
)
def test_a_format_says_whether_there_is_an_offset(form, text, utc):
    found, _ = stamps([text], Time(column="t", zone="Europe/Amsterdam", format=form))
    assert str(np.datetime64(int(found[0]), "s")) == utc


@pytest.mark.parametrize(
    ("form", "text", "said"),
    [
        ("%H:%H", "01:00", "which has no year"),
        ("%Y-%m-%d %Q", "2022-03-01 1", "nothing can be read .*'Q' is a bad directive"),
        ("%%Y %d/%m %H", "%Y 01/03 01", "which has no year"),
        ("mixed", "03/04/2022", "which has no year; expected 'ISO8601', 'unix', or a format such as"),
    ],
)
def test_a_format_that_reads_no_time_is_named(form, text, said):
    with pytest.raises(RecordingError, match=f"^file: time.format is '{re.escape(form)}', .*{said}"):
        stamps([text, text], Time(column="t", zone="Europe/Amsterdam", format=form))


@pytest.mark.parametrize(
    ("form", "texts"),
    [
        ("ISO8601", ["2022-03-01T23:00:00+01:00", "2022-03-01T24:00:00+01:00", "2022-03-02T01:00:00+01:00"]),
        ("%d.%m.%Y %H:%M", ["24.03.2022 23:00", "24.03.2022 24:00", "25.03.2022 01:00"]),
    ],
)
def test_the_end_of_a_day_is_the_next_ones_beginning(form, texts):
    found = read_stamps(pd.Series(texts), Time(column="t", zone="Europe/Amsterdam", format=form), "here")
    utc, notes = found.utc, found.notes
    np.testing.assert_array_equal(np.diff(utc), [3600.0, 3600.0])
    assert notes == ["1 time stamps of 24:00 are taken as 00:00 of the next day"]


@pytest.mark.parametrize(
    ("zone", "hours"),
    [
        ("Europe/Dublin", 0),
        ("Australia/Lord_Howe", 10.5),
        ("-03:30", -3.5),
    ],
)
def test_standard_time_knows_no_daylight_saving(zone, hours):
    for month in (1, 7):
        moment = datetime(2022, month, 3, tzinfo=UTC).timestamp()
        assert standard_offset(find_zone(zone), moment) == hours * 3600


@given(
    moment=st.datetimes(datetime(1995, 1, 1), datetime(2080, 1, 1)).map(lambda t: t.replace(microsecond=0)),
    later=st.integers(0, 400 * 86400),
    zone=st.sampled_from(ZONES),
)
def test_a_remainder_gives_time_of_day_and_weekday(moment, later, zone):
    first = moment.replace(tzinfo=UTC).timestamp()
    clock = make_clock(zone, find_zone(zone), first)
    seconds = float(clock.seconds(np.array([first + later]))[0])
    local = moment + timedelta(seconds=later + clock.offset)
    assert seconds % 86400 == local.hour * 3600 + local.minute * 60 + local.second
    assert seconds // 86400 % 7 == local.weekday()
    assert clock.dates(np.array([seconds]))[0] == np.datetime64(local, "s")
    assert float(clock.utc(np.array([seconds]))[0]) == first + later


@pytest.mark.parametrize(
    ("texts", "zone"),
    [
        (["2021-09-07 00:00 +08:00", "2021-09-07 00:05 +08:00"], "+08:00"),
        (["2022-10-30T02:30:00+02:00", "2022-10-30T02:30:00+01:00"], "+01:00"),
        (["2022-01-01T00:00Z", "2022-01-02T00:00Z"], "in UTC; expected the place's clock"),
        (["2022-01-01T00:00+01:00", "2022-02-01T00:00+02:00", "2022-03-01T00:00+03:00"], "have the offsets"),
    ],
)
def test_offsets_of_the_stamps_tell_the_clock(texts, zone):
    if " " in zone:
        with pytest.raises(RecordingError, match=f"time.zone is missing, .*{zone}"):
            stamps(texts, Time(column="t"))
    else:
        found = read_stamps(pd.Series(texts), Time(column="t"), "file")
        assert found.zone == zone and "the clock is that of the stamps' own offset" in found.notes[0]
        assert found.utc[0] == datetime.fromisoformat(texts[0].replace(" +", "+")).timestamp()


@pytest.mark.parametrize(
    ("texts", "form"),
    [
        (["1/2/2022 1:00 PM", "1/2/2022 2:00 PM", "1/3/2022 1:00 AM"], "%m/%d/%Y %I:%M %p"),
        (["01-Jan-2022 00:00", "02-Jan-2022 00:00"], "%d-%b-%Y %H:%M"),
        (["1640991600", "1640995200"], "unix"),
        (["44562.5", "44562.75"], "excel"),
        (["20.5", "21.5"], None),
    ],
)
def test_the_format_of_stamps_is_found(texts, form):
    assert formats_of(pd.Series(texts)) == ([] if form is None else [form])


def test_day_and_month_are_told_apart_by_the_order_of_time():
    hours = pd.Series(pd.date_range("2022-03-04", periods=60, freq="6h").strftime("%d/%m/%Y %H:%M"))
    assert formats_of(hours) == ["%d/%m/%Y %H:%M"]
    assert len(formats_of(hours.head(4))) == 2  # one day tells nothing


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


@settings(max_examples=100)
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


def test_rows_across_two_autumns_are_known_as_newest_first():
    stamps = pd.date_range("2021-10-01", "2022-12-01", freq="30min", tz="Europe/Amsterdam").tz_localize(None)
    texts = pd.Series(stamps.strftime("%Y-%m-%d %H:%M"))
    assert runs_backwards(texts[::-1], "ISO8601") and not runs_backwards(texts, "ISO8601")
    assert not runs_backwards(pd.concat([texts[5000:], texts[:5000]]), "ISO8601")


@pytest.mark.parametrize(
    ("zone", "latitude"),
    [("America/New_York", 40.7), ("US/Eastern", 40.7), ("Australia/Sydney", -33.9), ("Etc/GMT-1", None), ("x", None)],
)
def test_where_the_town_of_a_zone_lies(zone, latitude):
    assert latitude_of(zone) == (latitude if latitude is None else pytest.approx(latitude, abs=0.1))
