"""Whether a weather file can be true: its radiation against the sun of its place and clock, its columns against rest.

A time zone or longitude of the wrong sign, rows in local time under a header in UTC, or rows named by the hour's start
change no single value, and put another sun on a facade. Two figures tell them: the share of the radiation that falls
while the sun is down, and how well global irradiance is diffuse plus the horizontal part of direct irradiance. The
second one also tells radiation that contradicts itself, whatever the clock. Columns that stand still are found by the
rules of measured ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from datagen.driving.weather_record import (
    MONTHS,
    OPTIONAL,
    RADIATION,
    SPELLING,
    HourlyRecord,
    sun_over,
    sunlit_middles,
)
from shared.errors import WeatherError
from shared.logs import logger
from shared.still import CALM, RESTING, STUCK_AFTER, Resting, long_runs

_log = logger(__name__)

DOWN = 92.0
"""Zenith [degree] from which the sun counts as down."""
IN_THE_DARK = 0.25
"""Share of the radiation that falls while the sun is down from which a file is refused, whatever else it holds."""
OTHERWISE = 0.5
"""Another clock or place that leaves less than this share of the misfit is taken for the right one."""
LEAST = 10.0
"""A misfit up to this says nothing [W/m2]."""
CONTRADICTION = (0.08, 0.15)
"""Share of a month's global radiation that diffuse and direct may miss, from which a file is told of, and refused.

Long and Shi (2008, "An automated quality assessment and control algorithm for surface radiation measurements", Open
Atmospheric Science Journal 2) question a single minute of a station beyond 8 % while the sun is higher than 15 degree,
and beyond 15 % while it is lower. A month's sum is held to what one minute is held to.
"""
LIT = 80.0
"""Zenith [degree] up to which some light falls in every hour: a tenth of the sun's 1361 W/m2 and more meets the
horizontal above the air there, of which the thickest clouds let some per cent through."""
RESTS = {"K": (24.0, 72.0), "m/s": (24.0, 72.0), "W/m2": (STUCK_AFTER, 72.0)}
"""How long a column may show one value [h], by unit: told of beyond the first, refused beyond the second.

A sensor is taken for stuck after half a day. Weather files are rounded and joined from reports, so that temperature
and wind of good ones rest for longer: here 24 h, the cycle of the day. Nothing of the weather keeps one value over
three of these. The sun moves within the hour. Of wind that is zero see :data:`CALMS`."""
CALMS = (CALM, 336.0)
"""How long wind may be exactly zero [h], likewise: a winter's high lies over a valley for up to two weeks."""
MOVING = {
    "temp_air": "K",
    "temp_dew": "K",
    "wind_speed": "m/s",
    "ghi": "W/m2",
    "dhi": "W/m2",
    "infrared": "W/m2",
}
"""Columns that never stand still, and their units. The beam of overcast days is zero from morning to night, and so is
left out; whole hectopascals rest for days."""
READINGS = ("temp_air", "temp_dew", "wind_speed", "wind_direction", "pressure")
"""Columns of which one at least changes within half a day; rounded each may rest."""
SHIFTS = (*range(-6, 0), *range(1, 7))
"""Hours by which rows may be misnamed while most of the radiation is still of daylight."""


def check_sun(path: Path, record: HourlyRecord) -> None:
    """Hold a file's radiation against where the sun stands by its place and its rows, and against itself.

    Of instants in place of means, half an hour off, and of a smaller contradiction it warns. Raises WeatherError if
    there is no radiation, if much of it falls while the sun is down, if global, direct and diffuse irradiance agree far
    better with the sun of another clock, by an hour or more, or of the other hemisphere, or if they contradict each
    other in a month by more than :data:`CONTRADICTION` whatever the clock.
    """
    ghi = record.columns["ghi"]
    if not any(record.columns[name].any() for name in RADIATION):
        raise WeatherError(
            f"{path}: global, direct and diffuse radiation are zero all year; expected a year with sun: take a file"
            " with radiation, or fill these columns from a typical year of the place"
        )
    sun = _Sun(record)
    place = f"latitude {record.latitude:g}, longitude {record.longitude:g}, time zone {record.utc_offset:+g} h"
    expected = (
        "expected degrees north, degrees east, hours east of Greenwich, and hours of local standard time that are named"
        " by their end"
    )
    dark = ghi[sun.zenith() > DOWN].sum() / max(ghi.sum(), 1.0)
    if dark > IN_THE_DARK:
        raise WeatherError(
            f"{path}: {dark:.0%} of the global horizontal radiation falls while the sun is down at {place}; {expected}"
        )
    here = sun.misfit()
    if here <= LEAST:
        _check_contradiction(path, sun, 0.0)
        return
    others = {f"the sun {abs(h)} h {'later' if h > 0 else 'earlier'}": sun.misfit(h) for h in SHIFTS}
    others["the sun of the other hemisphere"] = _Sun(replace(record, latitude=-record.latitude)).misfit()
    best = min(others, key=others.__getitem__)
    if others[best] < OTHERWISE * here:
        raise WeatherError(
            f"{path}: global horizontal radiation is diffuse and direct radiation's to {here:.0f} W/m2 rms with the sun"
            f" of {place}, and to {others[best]:.0f} W/m2 with {best}; {expected}"
        )
    half = min((0.5, -0.5), key=sun.misfit)
    left = sun.misfit(half)
    _check_contradiction(path, sun, half if left < here else 0.0)
    if left < OTHERWISE * here:
        _log.warning(
            "%s: global horizontal radiation is diffuse and direct radiation's to %.0f W/m2 rms with the sun in the"
            " middle of each hour, and to %.0f W/m2 with the sun half an hour %s, as of instants: they are taken for"
            " means of the hour, so that the sun stands half an hour off",
            *(path, here, left, "later" if half > 0 else "earlier"),
        )


@dataclass
class _Sun:
    """Where the sun stands over a record by this and by other clocks, each worked out once."""

    record: HourlyRecord
    known: dict[float, np.ndarray] = field(default_factory=dict)

    def zenith(self, later: float = 0.0) -> np.ndarray:
        """In the middle of each hour's sunlit part, shape (8760,) [degree]; ``later`` [h] by another clock."""
        if later not in self.known:
            self.known[later] = sun_over(sunlit_middles(self.record, later), self.record).zenith
        return self.known[later]

    def globals(self, later: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Global irradiance as it stands, and that of diffuse and direct irradiance, shape (8760,) each [W/m2]."""
        ghi, dni, dhi = (self.record.columns[name] for name in RADIATION)
        return ghi, dhi + dni * np.maximum(np.cos(np.radians(self.zenith(later))), 0.0)

    def misfit(self, later: float = 0.0) -> float:
        """Root mean square of their difference where there is any light [W/m2]."""
        ghi, others = self.globals(later)
        return float(np.sqrt(np.mean((ghi - others)[(ghi > 0) | (others > 0)] ** 2)))


def _check_contradiction(path: Path, sun: _Sun, later: float) -> None:
    ghi, others = sun.globals(later)
    month = np.repeat(np.arange(12), 24 * MONTHS)
    apart = np.bincount(month, np.abs(ghi - others))
    lit = np.bincount(month, (ghi > 0) | (others > 0))
    share = apart / np.maximum(np.maximum(np.bincount(month, ghi), np.bincount(month, others)), 1.0)
    share[apart <= LEAST * lit] = 0.0  # rounding, of a dark month
    worst = int(share.argmax())
    told, refused = CONTRADICTION
    if share[worst] <= told:
        return
    empty = [SPELLING[name] for name in RADIATION if not sun.record.columns[name][month == worst].any()]
    sentence = (
        f"{path}: global horizontal radiation and the sum of diffuse and direct radiation on the horizontal differ by"
        f" {share[worst]:.0%} in month {worst + 1}, {apart[worst] / lit[worst]:.0f} W/m2 while there is light"
        f"{'; all zero in it: ' + ', '.join(empty) if empty else ''}"
    )
    if share[worst] > refused:
        raise WeatherError(
            f"{sentence}; expected at most {refused:.0%}: measured columns that agree, or two made of the global one by"
            " one model, as by pvlib.irradiance.erbs, in place of zeros"
        )
    _log.warning("%s, where a good file has 1%%: the sun on a facade is as uncertain", sentence)


# ---------------------------------------------------------------- what stands still


def check_still(path: Path, record: HourlyRecord) -> HourlyRecord:
    """Hold a file's columns against rest, by the rules for measured columns; of what is doubtful it warns.

    A column that a file need not have, and that rests for longer than the weather can, is not in what is returned.
    Raises WeatherError if one rests so long that a file must have, or the sun is up and shines on nothing, or all
    readings rest at once for longer than one sensor may.
    """
    columns, absent = dict(record.columns), dict(record.absent)
    for name, unit in MOVING.items():
        if name not in columns:
            continue
        told, refused = RESTS[unit]
        still = _longest_run(columns[name], told, {**RESTING, "K": None}[unit])
        if still is None:
            continue
        value = columns[name][still.first]
        what = f"{SPELLING[name]} is {value:g} {unit} {still}"
        if unit == "m/s" and value == 0:
            refused = CALMS[1]
        if still.hours > refused and name in OPTIONAL:
            absent[name] = what
            del columns[name]
            _log.warning("%s: %s, as no weather does: the column is not used", path, what)
        else:
            _say(path, what, still.hours, refused)
    _check_dark_days(path, record)
    _check_copies(path, record)
    return replace(record, columns=columns, absent=absent)


@dataclass(frozen=True)
class _Still:
    """A run of equal values: the row that it begins with, and its length [h]."""

    first: int
    hours: float

    def __str__(self) -> str:
        return f"for {self.hours:.0f} h from hour {self.first + 1} (day {self.first // 24 + 1} of the year)"


def _longest_run(values: np.ndarray, hours: float, resting: Resting | None = None) -> _Still | None:
    """The longest run of equal values of those that last longer than ``hours`` [h]."""
    time = 3600.0 * np.arange(len(values) + 1)
    joined = np.ones(len(values) - 1, dtype=bool)
    runs = long_runs(values, time[:-1], time[1:], hours, resting, joined)
    if not runs.first.size:
        return None
    k = int(runs.hours.argmax())
    return _Still(int(runs.first[k]), float(runs.hours[k]))


def _check_dark_days(path: Path, record: HourlyRecord) -> None:
    """Hours with the sun up count as if they followed each other: nights lie between."""
    lit = np.flatnonzero(_Sun(record).zenith() < LIT)
    if lit.size < 2:
        return
    ghi = record.columns["ghi"][lit]
    dark = _longest_run(np.where(ghi > 0, np.arange(1.0, lit.size + 1), 0.0), STUCK_AFTER)
    if dark is not None:
        told = _Still(int(lit[dark.first]), dark.hours)
        _say(path, f"global horizontal radiation is 0 W/m2 while the sun is up {told}", told.hours, RESTS["W/m2"][1])


def _check_copies(path: Path, record: HourlyRecord) -> None:
    """All readings at once: rows were copied, or the whole station stood still."""
    names = [name for name in READINGS if name in record.columns]
    table = np.stack([record.columns[name] for name in names])
    changes = np.cumsum(np.concatenate([[0], (np.diff(table, axis=1) != 0).any(axis=0)]))
    copied = _longest_run(changes.astype(np.float64), STUCK_AFTER)
    if copied is not None:
        what = ", ".join(SPELLING[name] for name in names)
        _say(path, f"{what} are all the same {copied}", copied.hours, STUCK_AFTER)


def _say(path: Path, what: str, hours: float, refused: float) -> None:
    """Warn of a run, or refuse it."""
    if hours > refused:
        raise WeatherError(
            f"{path}: {what}; expected at most {refused:.0f} h: these rows are frozen or empty, so fill them from"
            " another year, or take another file"
        )
    _log.warning("%s: %s: it is believed, though a sensor would be taken for stuck", path, what)
