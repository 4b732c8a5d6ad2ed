"""Time stamps: from what loggers write to seconds on the building's own clock without daylight saving.

A recording keeps **local standard time**: every day has 24 hours and the sun keeps its place in them. Its time runs
from a Monday 00:00 near 1 January of the year in which it begins, so that a remainder gives time of day and day of
week as for simulated years (time zero of those is Monday 1 January 2001), the season is right within three days, and
the numbers stay small. The date of that Monday is in the units of the file's time: the calendar is not lost.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta, tzinfo
from itertools import pairwise

import numpy as np
import pandas as pd

from diagnosis.measurements.mapping import Time
from diagnosis.measurements.signal import even
from diagnosis.measurements.zones import find_zone
from shared.errors import RecordingError
from shared.reading import shown, why
from shared.times import time_zero

Sensors = Callable[[], np.ndarray]
"""Says of each row which sensors it holds a reading of, shape (rows, sensors): asked only where it matters."""
_OFTEN, _RARELY = 0.75, 1.25
"""A sensor whose usual interval is more than the first share of the repeated hour need not see the clock go back; one
beyond the second may have no reading in either pass."""
_APART = 1.5
"""Rows so many usual intervals apart have lost one between them."""


def seconds_of(index: pd.DatetimeIndex) -> np.ndarray:
    """Aware or naive stamps as they read [s since 1970], same shape."""
    naive = index.tz_convert("UTC").tz_localize(None) if index.tz is not None else index
    return np.asarray((naive - pd.Timestamp(0)) / pd.Timedelta(seconds=1), dtype=np.float64)


def of_wall_clock(
    stamps: pd.DatetimeIndex, zone: tzinfo, name: str, where: str, sensors: Sensors | None = None
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Naive stamps of a zone's wall clock to UTC [s since 1970] and which may be an hour off, both (rows,); and notes.

    Stamps of the repeated hour are of the first pass until the clock goes back: for a row, or for a sensor that was
    read at the same stamp before, or whose usual interval says so. If there is no such row, an hour is missing: where
    rows at a usual interval have one gap, within the hour or beside it, that took it, and where they have none or
    several, nothing tells. Rows at no usual interval are of the first pass, or of the second where that alone has rows
    beside it: they may be changes, which are not to be lost. Raises RecordingError if stamps lie in the hour that
    daylight saving skips, or the order of rows does not tell the passes apart.
    """
    first = stamps.tz_localize(zone, ambiguous=np.ones(len(stamps), dtype=bool), nonexistent="NaT")
    second = stamps.tz_localize(zone, ambiguous=np.zeros(len(stamps), dtype=bool), nonexistent="NaT")
    lost = np.flatnonzero(first.isna())
    if lost.size:
        raise RecordingError(
            f"{where}: {stamps[lost[0]]} does not exist in {name}, where daylight saving skips it; if the logger keeps "
            "standard time all year, expected zone as an offset such as '+01:00'"
        )
    early, late, wall = seconds_of(first), seconds_of(second), seconds_of(stamps)
    repeated = early != late
    doubtful = np.zeros(len(wall), dtype=bool)
    if not repeated.any():
        return early, doubtful, []
    read = sensors() if sensors is not None else np.empty((len(wall), 0), dtype=bool)
    if not read.shape[1]:
        read = np.ones((len(wall), 1), dtype=bool)
    hour = float((late - early).max())
    rows = _Rows(wall, read, *_usual(wall, read, hour), hour, name, where)
    utc = early.copy()
    for start in np.flatnonzero(repeated & ~np.concatenate([[False], repeated[:-1]])).tolist():
        stop = start + int(np.argmin(np.concatenate([repeated[start:], [False]])))
        second_pass = rows.second_pass(start, stop)
        if second_pass is None:
            doubtful[start:stop] = True
        else:
            utc[second_pass:stop] = late[second_pass:stop]
    again = int((utc != early).sum())
    notes = []
    if not again and not repeated[-1]:
        notes.append(
            "the hour that the end of daylight saving repeats is there once only: if the logger keeps standard time"
            " all year, write time.stamps as an offset such as '+01:00'"
        )
    notes.append(
        f"{int(repeated.sum())} stamps fall in the hour that the end of daylight saving repeats: {again} of them, from"
        " where the clock goes back, are taken for its second pass"
        + (
            f"; {int(doubtful.sum())} of them are left out, because nothing tells which pass they are of (an offset in"
            " the stamps, as 2022-10-30 02:15:00+01:00, would)"
            if doubtful.any()
            else ""
        )
    )
    return utc, doubtful, notes


def _usual(wall: np.ndarray, read: np.ndarray, hour: float) -> tuple[np.ndarray, np.ndarray]:
    """How soon each sensor cannot be read again, and the usual interval of those that are seldom, both (sensors,) [s].

    Half the usual interval, of one that is read hourly or more seldom; others may be read as soon as they like, but not
    at the same stamp, and the interval of what is read hourly at least is given as zero.
    """
    near, rarely = np.zeros(read.shape[1]), np.zeros(read.shape[1])
    for k in range(read.shape[1]):
        apart = np.diff(wall[read[:, k]])
        if even(apart) and np.median(apart) > _OFTEN * hour:
            usual = float(np.median(apart))
            near[k], rarely[k] = 0.5 * usual, usual if usual > _RARELY * hour else 0.0
    return near, rarely


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of a wall clock [s], (rows,), the sensors that they hold, (rows, sensors), and what is usual of these."""

    wall: np.ndarray
    read: np.ndarray
    near: np.ndarray
    rarely: np.ndarray
    hour: float
    name: str
    where: str

    def second_pass(self, start: int, stop: int) -> int | None:
        """The first row of the second pass, of rows ``start`` to ``stop`` in a repeated hour; ``stop`` if none is.

        None if nothing tells.
        """
        wall, read = self.wall, self.read
        falls = np.flatnonzero(np.diff(wall[start:stop]) < 0)
        # a file whose rows are written twice repeats stamps in either pass: there only the clock tells
        within = np.where(self.near > 0, self.near, -1.0) if falls.size else self.near
        last, held = np.full(read.shape[1], -np.inf), np.full(read.shape[1], -1)
        for sensor in np.flatnonzero(self.rarely):  # of one that has no reading in the first pass the one before counts
            last[sensor] = wall[:start][read[:start, sensor]].max(initial=-np.inf)
        back = stop
        for k in range(start, stop):
            soon = read[k] & (wall[k] - last <= within)
            soon |= read[k] & self._later(wall[k] - last)
            again = soon & (held >= back)
            if again.any() and not falls.size:
                raise RecordingError(
                    f"{self.where}: row {k + 1} ({pd.Timestamp(wall[k], unit='s')}) has a reading of what row"
                    f" {int(held[again][0]) + 1} has one of, in the hour that the end of daylight saving repeats in"
                    f" {self.name}, and the order of rows does not tell its two passes apart; expected rows in the"
                    " order of time, or stamps with an offset as 2022-10-30 02:15:00+01:00"
                )
            if back == stop and (soon.any() or (falls.size and k == start + falls[0] + 1)):
                back = k
            last[read[k]], held[read[k]] = wall[k], k
        return back if back < stop else self._at_a_gap(start, stop)

    def _later(self, apart: np.ndarray) -> np.ndarray:
        """Whether an hour more makes times [s] since a seldom reading more nearly its usual interval, or so many."""
        told = (self.rarely > 0) & np.isfinite(apart)
        usual = np.where(told, self.rarely, 1.0)
        apart = np.where(told, apart, 0.0)
        off = [np.abs(one - usual * np.round(one / usual)) for one in (apart, apart + self.hour)]
        return np.asarray(told & (off[1] < off[0]))

    def _at_a_gap(self, start: int, stop: int) -> int | None:
        """The row, of ``start`` to ``stop``, before which the missing hour was lost; None if nothing tells."""
        step = np.diff(self.wall)
        step = step[step > 0]
        if self.rarely[self.read[start:stop].any(axis=0)].all() or (start == 0 and stop == len(self.wall)):
            return stop  # their intervals have told, or nothing is beside them
        if not even(step):
            return start if self._after_a_gap(start, stop) else stop
        beside = np.concatenate([[np.inf], np.diff(self.wall), [np.inf]])[start : stop + 1]
        gaps = np.flatnonzero(beside > _APART * float(np.median(step)))
        return start + int(gaps[0]) if len(gaps) == 1 else None

    def _after_a_gap(self, start: int, stop: int) -> bool:
        """Whether rows follow those in the repeated hour as closely as usual, and none are so close before them."""
        step = np.diff(self.wall)
        usual = 1.5 * float(np.median(step[step > 0])) if (step > 0).any() else 0.0
        follows = stop < len(self.wall) and step[stop - 1] <= usual
        return bool(follows and (start == 0 or step[start - 1] > usual))


FIRST, LAST = (datetime(year, 1, 1, tzinfo=UTC).timestamp() for year in (1900, 2200))
"""Time stamps that can be of measurements [s since 1970]."""
DAY, MONTH = 86400.0, 25 * 86400.0
"""Seconds of a day, and what is about a month at least."""
SINCE = datetime(1980, 1, 1, tzinfo=UTC).timestamp()
"""Loggers that count parts of a second did not before [s since 1970]."""
_OFFSET = re.compile(r"([+-])(\d{2}):?(\d{2})$")
_YEAR = re.compile(r"(?<!%)(?:%%)*%[YyGcx]")
_UTC = ("Z", "UTC", "GMT")
_END_OF_DAY = r"(?<![\d:])24(?=:00(?::00(?:[.,]0+)?)?(?![\d:]))"
"""The hour of a day's last instant, as some loggers write the next day's first."""
_STAMPED = r"(?:[Zz]|[+-]\d{2}:?\d{2}|[+-]\d{2})$"


@dataclass(frozen=True)
class Clock:
    """The building's clock.

    Attributes
    ----------
    zone
        As the mapping names it.
    offset
        Local standard time minus UTC [s].
    zero
        The Monday from whose 00:00 local standard time the recording's time runs.
    """

    zone: str
    offset: float
    zero: date

    @property
    def units(self) -> str:
        """CF units of the recording's time."""
        return f"seconds since {self.zero.isoformat()} 00:00:00"

    def seconds(self, utc: np.ndarray) -> np.ndarray:
        """UTC [s since 1970] to the recording's time [s since ``zero``], same shape."""
        return np.asarray(utc, dtype=np.float64) + self.offset - _epoch(self.zero)

    def utc(self, seconds: np.ndarray) -> np.ndarray:
        """The recording's time [s] to UTC [s since 1970], same shape."""
        return np.asarray(seconds, dtype=np.float64) - self.offset + _epoch(self.zero)

    def dates(self, seconds: np.ndarray) -> np.ndarray:
        """The recording's time [s] as dates of local standard time, datetime64[s]."""
        whole = np.round(np.asarray(seconds, dtype=np.float64)).astype("int64")
        return np.asarray(np.datetime64(self.zero.isoformat(), "s") + whole.astype("timedelta64[s]"))

    def text(self, seconds: float) -> str:
        """A time as people read it."""
        return str(self.dates(np.array([seconds]))[0]).replace("T", " ")[:16]


def _epoch(day: date) -> float:
    return datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()


def standard_offset(zone: tzinfo, utc: float) -> float:
    """Standard time minus UTC [s] in the year that begins at ``utc`` [s since 1970]: the smallest offset of its months.

    Not ``utcoffset - dst``: zones whose law calls winter time the daylight saving (Ireland) say otherwise there. Nor of
    the calendar year: in November 2016 Istanbul had left the standard time that its January had.
    """
    months = [datetime.fromtimestamp(utc + DAY * 365.25 * part / 12, UTC) for part in range(12)]
    offsets = [month.astimezone(zone).utcoffset() for month in months]
    return min(one.total_seconds() for one in offsets if one is not None)


def make_clock(name: str, zone: tzinfo, first: float) -> Clock:
    """The clock of a recording whose first reading is at ``first`` [s since 1970, UTC]."""
    offset = standard_offset(zone, first)
    local = datetime.fromtimestamp(first, UTC) + timedelta(seconds=offset)
    return Clock(name, offset, time_zero(local.date()))


@dataclass(frozen=True)
class Stamps:
    """Time stamps that were understood.

    Attributes
    ----------
    utc
        Shape (rows,) [s since 1970]; NaN where nothing tells which pass of a repeated hour a stamp is of.
    zone
        The place's clock: the mapping's, else that of the stamps' own offsets.
    notes
        Sentences on how they were understood.
    """

    utc: np.ndarray
    zone: str
    notes: list[str]


def read_stamps(texts: pd.Series, settings: Time, where: str, sensors: Sensors | None = None) -> Stamps:
    """Time stamps (rows,) to UTC.

    Stamps with an offset or a Z mean what they say. Stamps without are of the zone's wall clock; the hour that the end
    of daylight saving repeats is its first pass until the clock goes back, and its second from there on. Rows of one
    stamp may be of several ``sensors`` or of two passes; if these are not given, one sensor is in every row. Raises
    RecordingError if stamps cannot be read, lie in the hour that daylight saving skips, run backwards, do not tell
    which pass of the repeated hour they are of, or neither they nor the mapping say how the place's clock runs.
    """
    texts = texts.str.strip()
    empty = texts.isna() | (texts == "")
    if empty.any():
        k = int(np.flatnonzero(empty)[0])
        raise RecordingError(
            f"{where}: row {k + 1} has no time stamp; expected one in each row that holds something: write it, or"
            " remove the row"
        )
    form = settings.format
    if form == "unix":
        name, doubtful = _zone_of(settings, where), np.zeros(len(texts), dtype=bool)
        find_zone(name)
        utc, notes = _counted(texts, form, settings, where)
    elif form == "excel" or (form == "ISO8601" and _are_serial(texts)):
        name = settings.stamps or _zone_of(settings, where)
        wall, notes = _counted(texts, "excel", settings, where)
        utc, doubtful, told = of_wall_clock(_dates(wall), find_zone(name), name, where, sensors)
        notes += told
    else:
        utc, doubtful, name, notes = _written(texts, settings, where, sensors)
    odd_year = np.flatnonzero((utc < FIRST) | (utc > LAST))
    if odd_year.size:
        k = int(odd_year[0])
        raise RecordingError(
            f"{where}: row {k + 1} ({shown(texts.iloc[k])}) is not of the years 1900 to 2199"
            f"{'; expected seconds since 1970, or milliseconds' if form == 'unix' else ''}"
        )
    back = np.flatnonzero(np.diff(utc) < 0)
    if back.size:
        k = int(back[0])
        raise RecordingError(
            f"{where}: time runs backwards from row {k + 1} ({shown(texts.iloc[k])}) to row {k + 2} "
            f"({shown(texts.iloc[k + 1])}) in {back.size} place(s); expected rows in the order of time:"
            f" sort them, or remove the rows that were written twice{_cut_off(texts, k + 1)}"
        )
    if form not in ("ISO8601", "unix", "excel"):
        _no_months_for_days(utc, texts, settings, where)
    return Stamps(np.where(doubtful, np.nan, utc), settings.zone or name, notes)


def _zone_of(settings: Time, where: str) -> str:
    """The zone of the mapping.

    Raises RecordingError if it names none.
    """
    if settings.zone is None:
        raise RecordingError(
            f"{where}: time.zone is missing, and the stamps have no offset from UTC; expected the place's clock, as"
            " zone = 'Europe/Berlin'"
        )
    return settings.zone


_SERIAL = (25_000.0, 60_000.0)
"""Excel's days of today: 1968 to 2064."""
_EXCEL = datetime(1899, 12, 30, tzinfo=UTC).timestamp()


def _are_serial(texts: pd.Series) -> bool:
    """Whether all stamps are numbers that can be Excel's days, and no dates of ISO 8601."""
    first = texts.iloc[0].replace(",", ".")
    if not re.fullmatch(r"\d{5}(\.\d*)?", first):
        return False
    numbers = pd.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce")
    return bool(numbers.between(*_SERIAL).all())


def _dates(seconds: np.ndarray) -> pd.DatetimeIndex:
    """Seconds since 1970 as dates, to the millisecond: days in binary do not hold a second."""
    return pd.DatetimeIndex((np.round(seconds * 1e3)).astype("int64").astype("datetime64[ms]"))


def _counted(texts: pd.Series, form: str, settings: Time, where: str) -> tuple[np.ndarray, list[str]]:
    """Stamps that count seconds since 1970 (or parts of them) or days since 1899-12-30, (rows,) [s since 1970]."""
    numbers = pd.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce").to_numpy(dtype=np.float64)
    _all_read(~np.isfinite(numbers), texts, settings, where)
    return _since_1970(numbers, form)


def _since_1970(numbers: np.ndarray, form: str) -> tuple[np.ndarray, list[str]]:
    """Numbers that count time, (rows,), as seconds since 1970, and a sentence on what they were taken for."""
    if form == "excel":
        return _EXCEL + 86400.0 * numbers, ["the time stamps are taken as Excel's: days since 1899-12-30"]
    for parts, name in ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")):
        if SINCE * parts <= np.nanmin(numbers) and np.nanmax(numbers) <= LAST * parts:
            return numbers / parts, [f"the time stamps are taken as {name} since 1970"]
    return numbers, []


def _written(
    texts: pd.Series, settings: Time, where: str, sensors: Sensors | None
) -> tuple[np.ndarray, np.ndarray, str, list[str]]:
    """Dates as text: UTC [s since 1970] and which may be an hour off, both (rows,); the clock's zone; and notes."""
    if settings.format == "ISO8601":
        stamped = texts.str.contains(_STAMPED, regex=True) & texts.str.contains(":", regex=False)
    else:  # a date may stand where an offset could: the format says which it is
        _check_format(settings.format, where)
        stamped = pd.Series("%z" in settings.format or settings.format.endswith(_UTC), index=texts.index)
    if stamped.any() and not stamped.all():
        odd = int(np.flatnonzero(~stamped)[0])
        raise RecordingError(
            f"{where}: row {odd + 1} ({shown(texts.iloc[odd])}) has no offset from UTC but others have; "
            f"expected all or none{_cut_off(texts, odd)}"
        )
    aware = bool(stamped.all())
    name = settings.stamps or settings.zone or ""
    try:
        parsed, notes = _parsed(texts, settings.format, aware)
        _all_read(parsed.isna().to_numpy(), texts, settings, where)
        index = pd.DatetimeIndex(parsed)
        if aware:
            utc = seconds_of(index)
            if settings.zone is None:
                name, told = _zone_of_offsets(texts, settings, where)
                notes += told
            find_zone(name or str(settings.zone))
            return utc, np.zeros(len(utc), dtype=bool), name, notes
        name = name or _zone_of(settings, where)
        zone = find_zone(name)
        if settings.format != "ISO8601":  # first: the clock of another day may skip or repeat an hour
            _no_months_for_days(seconds_of(index), texts, settings, where)
        utc, doubtful, told = of_wall_clock(index, zone, name, where, sensors)
        return utc, doubtful, name, notes + told
    except TypeError:
        raise RecordingError(
            f"{where}: offsets from UTC cannot be read; expected ISO 8601 with colons, 2022-10-30 02:15:00+01:00,"
            " or time.format"
        ) from None
    except (ValueError, ArithmeticError) as error:
        raise RecordingError(f"{where}: times cannot be read ({why(error)}); expected times of today") from None


def _zone_of_offsets(texts: pd.Series, settings: Time, where: str) -> tuple[str, list[str]]:
    """The clock that the stamps' own offsets are of: one, or two of which daylight saving is an hour ahead; a note.

    Raises RecordingError if they are all UTC, which is the logger's clock and hardly the place's, or of several other
    clocks.
    """
    written = texts.str.extract(r"([+-]\d{2}):?(\d{2})?\s*$")
    hours = pd.to_numeric(written[0], errors="coerce").fillna(0.0)
    minutes = pd.to_numeric(written[1], errors="coerce").fillna(0.0) * np.where(written[0].str[0] == "-", -1, 1)
    offsets = sorted({int(one) for one in 60 * hours + minutes})
    said = [f"{'-' if one < 0 else '+'}{abs(one) // 60:02d}:{abs(one) % 60:02d}" for one in offsets]
    if offsets == [0] or len(offsets) > 2 or offsets[-1] - offsets[0] > 60:
        what = "are in UTC" if offsets == [0] else f"have the offsets {', '.join(said[:9])}"
        raise RecordingError(
            f"{where}: time.zone is missing, and the stamps {what}; expected the place's clock, as zone ="
            " 'Europe/Berlin'"
        )
    summer = f"; those of {said[1]} are of daylight saving" if len(said) > 1 else ""
    may = "" if summer else ", all year: where that is daylight saving, write time.zone"
    return said[0], [f"the clock is that of the stamps' own offset, {said[0]}{summer}{may}"]


def _parsed(texts: pd.Series, form: str, aware: bool) -> tuple[pd.Series, list[str]]:
    """Stamps as dates, NaT where they are none, (rows,); 24:00 is the next day's 00:00, which is told."""
    parsed = pd.to_datetime(texts, format=form, errors="coerce", utc=aware)
    ends = parsed.isna() & texts.str.contains(_END_OF_DAY, regex=True)
    if not ends.any():
        return parsed, []
    begins = texts[ends].str.replace(_END_OF_DAY, "00", regex=True)
    parsed[ends] = pd.to_datetime(begins, format=form, errors="coerce", utc=aware) + pd.Timedelta(days=1)
    return parsed, [f"{int(ends.sum())} time stamps of 24:00 are taken as 00:00 of the next day"]


def _cut_off(texts: pd.Series, k: int) -> str:
    """What may be wrong with a stamp that is the last one and shorter than the one before it; else empty."""
    if k < len(texts) - 1 or not k or len(texts.iloc[k]) >= len(texts.iloc[k - 1]):
        return ""
    return "; it is the last one and shorter than the one before: is the file cut off there?"


def _check_format(form: str, where: str) -> None:
    """Refuse a format that nothing can be read with, or not the year: pandas would take 1900, or guess."""
    if "%Z" in form or (_OFFSET.search(form) and "%z" not in form):
        raise RecordingError(
            f"{where}: time.format is {form!r}; expected %z for an offset in the stamps, or none and time.stamps:"
            " letters and fixed offsets are not believed"
        )
    wanted = "'ISO8601', 'unix', or a format such as '%d/%m/%Y %H:%M'"
    if not _YEAR.search(form):
        raise RecordingError(f"{where}: time.format is {shown(form)}, which has no year; expected {wanted}")
    try:
        pd.to_datetime(["a text"], format=form, errors="coerce")
    except (ValueError, re.error) as error:  # the latter of a part that is there twice
        raise RecordingError(
            f"{where}: time.format is {shown(form)}, with which nothing can be read ({why(error)}); expected {wanted},"
            " with each part once"
        ) from None


def _no_months_for_days(utc: np.ndarray, texts: pd.Series, settings: Time, where: str) -> None:
    """Refuse times (rows,) [s] that jump by about a month after each day: days were read as months, or the reverse.

    They may be of the wall clock: an hour makes no month.
    """
    jumps = np.flatnonzero(np.diff(utc) > MONTH)
    if len(jumps) < 2:
        return
    ends = np.concatenate([[-1], jumps, [len(utc) - 1]])
    longest = float(max(utc[b] - utc[a + 1] for a, b in pairwise(ends)))
    if longest > 1.05 * DAY:
        return
    k = int(jumps[0])
    raise RecordingError(
        f"{where}: spans {(utc[-1] - utc[0]) / DAY:.0f} days, and jumps by about a month after each day, {len(jumps)}"
        f" times, as from row {k + 1} ({shown(texts.iloc[k])}) to row {k + 2} ({shown(texts.iloc[k + 1])}); expected"
        f" days that follow each other: time.format is {settings.format!r}, are day and month the other way round?"
    )


def _like(texts: pd.Series, form: str) -> str:
    """Which format reads all stamps that another one does not; empty if none does or several do."""
    found = [one for one in formats_of(texts) if one != form]
    return f"; did you mean time.format = {found[0]!r}?" if len(found) == 1 else ""


_DATE = r"(\d{1,4})([./-])(\d{1,2}|[A-Za-z]{3,9})\2(\d{1,4})"
_CLOCK = r"(\d{1,2}):(\d{2})(:\d{2})?([.]\d+)?(\s*[AaPp][Mm])?(\s*(?:Z|[+-]\d{2}:?\d{2}))?"


def formats_of(texts: pd.Series) -> list[str]:
    """Formats that read all stamps (rows,) of a file: 'ISO8601', 'unix', 'excel', or of strptime; best first.

    Of day and month the wrong way round both are given, if both read all and neither jumps by a month after each day.
    """
    texts = texts.str.strip()
    first = str(texts.iloc[0])
    if re.fullmatch(r"[\d.,]+", first) and (counted := _number_formats(texts)):
        return counted
    if _readable(texts, "ISO8601") and not re.fullmatch(r"\d{1,7}", first):
        return ["ISO8601"]
    shape = re.fullmatch(rf"{_DATE}(?:(,?\s+|T){_CLOCK})?", first)
    if shape is None:
        return []
    date = _date_formats(*shape.group(1, 2, 3, 4))
    clock = ""
    if shape[5]:
        half = bool(shape[10])
        seconds = (":%S" if shape[8] else "") + (".%f" if shape[9] else "")
        blank = " " if half and shape[10][0] == " " else ""
        zone = ((" " if shape[11][0] == " " else "") + "%z") if shape[11] else ""
        clock = f"{shape[5]}%{'I' if half else 'H'}:%M{seconds}{blank}{'%p' if half else ''}{zone}"
    found = [one + clock for one in date if _readable(texts, one + clock)]
    return _in_order(texts, found) if len(found) > 1 else found


def read_naive(texts: pd.Series, form: str) -> np.ndarray:
    """Stamps as they read, whatever their zone, (rows,) [s]; NaN where they cannot be read."""
    if form in ("unix", "excel"):
        numbers = pd.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce").to_numpy(dtype=np.float64)
        return _since_1970(numbers, form)[0]
    if form == "ISO8601":
        texts = texts.str.replace(_STAMPED, "", regex=True).where(texts.str.contains(":", regex=False), texts)
        texts = texts.str.strip()
    elif form.endswith("%z"):
        texts, form = texts.str.replace(_STAMPED, "", regex=True).str.strip(), form.removesuffix("%z").rstrip()
    parsed = _parsed(texts, form, False)[0]
    return np.where(parsed.isna(), np.nan, seconds_of(pd.DatetimeIndex(parsed)))


def runs_backwards(texts: pd.Series, form: str) -> bool:
    """Whether stamps (rows,) are newest first, all but the hour that the end of daylight saving repeats."""
    texts = texts.fillna("").str.strip()
    try:
        if form in ("unix", "excel") or (form == "ISO8601" and _are_serial(texts)):
            steps = np.diff(pd.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce"))
        else:
            steps = np.diff(read_naive(texts, form))
    except (RecordingError, ValueError, TypeError, ArithmeticError):  # it is said where they are read
        return False
    autumns = 1 + abs(float(steps.sum())) / (366 * DAY)
    return bool(np.all(steps < 3600.0)) and int((steps > 0).sum()) <= autumns and float(steps.sum()) < 0


def _readable(texts: pd.Series, form: str) -> bool:
    try:
        return not _parsed(texts, form, True)[0].isna().any()
    except (ValueError, TypeError, ArithmeticError):
        return False


def _number_formats(texts: pd.Series) -> list[str]:
    numbers = pd.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce")
    if numbers.between(*_SERIAL).all():
        return ["excel"]
    for form, digits in (("%Y%m%d%H%M%S", 14), ("%Y%m%d%H%M", 12), ("%Y%m%d", 8)):
        if texts.str.fullmatch(rf"\d{{{digits}}}").all() and _readable(texts, form):
            return [form]
    if any(numbers.between(SINCE * parts, LAST * parts).all() for parts in (1.0, 1e3, 1e6, 1e9)):
        return ["unix"]
    return []


def _date_formats(first: str, sign: str, second: str, third: str) -> list[str]:
    """Formats that a date's three parts may be of."""
    if len(first) == 4:
        return [f"%Y{sign}%m{sign}%d"]
    year = "%Y" if len(third) == 4 else "%y"
    if second.isalpha():
        return [f"%d{sign}{'%b' if len(second) == 3 else '%B'}{sign}{year}"]
    return [f"%d{sign}%m{sign}{year}", f"%m{sign}%d{sign}{year}"]


def _in_order(texts: pd.Series, forms: list[str]) -> list[str]:
    """Those formats by which time runs forward most steadily: the least sum of what is beyond the usual step."""
    cost = []
    for form in forms:
        apart = np.diff(seconds_of(pd.DatetimeIndex(_parsed(texts, form, True)[0])))
        cost.append(float(np.abs(apart - np.median(apart)).sum()) if len(apart) else 0.0)
    return [form for form, one in zip(forms, cost, strict=True) if one <= min(cost) + DAY / 2]


def _all_read(bad: np.ndarray, texts: pd.Series, settings: Time, where: str) -> None:
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        raise RecordingError(
            f"{where}: row {k + 1} ({shown(texts.iloc[k])}) is not a time of format {settings.format!r}; expected "
            "ISO 8601 as 2022-10-30 02:15:00+01:00, or time.format set to 'unix', 'excel' or for example"
            f" '%d/%m/%Y %H:%M'{_like(texts, settings.format)}{_cut_off(texts, k)}"
        )
