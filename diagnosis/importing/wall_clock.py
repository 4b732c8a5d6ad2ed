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


def seconds_of(index: pd.DatetimeIndex) -> np.ndarray:
    """Aware or naive stamps as they read [s since 1970], same shape."""
    naive = index.tz_convert("UTC").tz_localize(None) if index.tz is not None else index
    return np.asarray((naive - pd.Timestamp(0)) / pd.Timedelta(seconds=1), dtype=np.float64)


def of_wall_clock(
    stamps: pd.DatetimeIndex, zone: tzinfo, name: str, where: str, sensors: Sensors | None = None
) -> tuple[np.ndarray, list[str]]:
    """Naive stamps of a zone's wall clock to UTC [s since 1970], shape (rows,), and sentences on the repeated hour.

    Its stamps are of the first pass until the clock goes back: for a row, or for a sensor that was read at the same
    stamp before, or much less than its usual interval ago. If there is no such row, they are of the first pass, or of
    the second where that alone has rows beside it.

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
    if not repeated.any():
        return early, []
    read = sensors() if sensors is not None else np.empty((len(wall), 0), dtype=bool)
    if not read.shape[1]:
        read = np.ones((len(wall), 1), dtype=bool)
    rows = _Rows(wall, read, *_usual(wall, read, float((late - early).max())), name, where)
    utc = early.copy()
    for start in np.flatnonzero(repeated & ~np.concatenate([[False], repeated[:-1]])).tolist():
        stop = start + int(np.argmin(np.concatenate([repeated[start:], [False]])))
        second_pass = rows.second_pass(start, stop)
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
        " where the clock goes back, are of its second pass"
    )
    return utc, notes


def _usual(wall: np.ndarray, read: np.ndarray, hour: float) -> tuple[np.ndarray, np.ndarray]:
    """How soon each sensor cannot be read again [s], and which sensors are read less than once an hour; (sensors,).

    Half the usual interval, of one that is read hourly or more seldom; others may be read as soon as they like, but not
    at the same stamp.
    """
    near, rarely = np.zeros(read.shape[1]), np.zeros(read.shape[1], dtype=bool)
    for k in range(read.shape[1]):
        apart = np.diff(wall[read[:, k]])
        if even(apart) and np.median(apart) > _OFTEN * hour:
            near[k], rarely[k] = 0.5 * np.median(apart), np.median(apart) > _RARELY * hour
    return near, rarely


@dataclass(frozen=True, eq=False)
class _Rows:
    """Rows of a wall clock [s], (rows,), the sensors that they hold, (rows, sensors), and what is usual of these."""

    wall: np.ndarray
    read: np.ndarray
    near: np.ndarray
    rarely: np.ndarray
    name: str
    where: str

    def second_pass(self, start: int, stop: int) -> int:
        """The first row of the second pass, of rows ``start`` to ``stop`` in a repeated hour; ``stop`` if none is."""
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
        return start if back == stop and self._after_a_gap(start, stop) else back

    def _after_a_gap(self, start: int, stop: int) -> bool:
        """Whether rows follow those in the repeated hour as closely as usual, and none are so close before them."""
        step = np.diff(self.wall)
        usual = 1.5 * float(np.median(step[step > 0])) if (step > 0).any() else 0.0
        follows = stop < len(self.wall) and step[stop - 1] <= usual
        return bool(follows and (start == 0 or step[start - 1] > usual))
