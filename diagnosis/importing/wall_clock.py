"""Stamps of a wall clock, which daylight saving puts forward and back: which pass of the hour that autumn repeats."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import tzinfo

import numpy as np
import pandas as pd

from diagnosis.importing.spacing import even
from shared.errors import RecordingError

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
    beside it: they may be changes, which are not to be lost.

    Raises
    ------
    RecordingError
        If stamps lie in the hour that daylight saving skips, or the order of rows does not tell the passes apart.
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
