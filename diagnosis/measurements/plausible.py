"""What readings look like beside what the system description declares: sentences for those who know the building."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from diagnosis.measurements import units
from diagnosis.measurements.clock import Clock
from diagnosis.measurements.grid import instants_of
from diagnosis.measurements.mapping import Place, Source
from diagnosis.measurements.register import is_register
from diagnosis.measurements.signal import DAY, Signal, usual_interval
from diagnosis.measurements.weather import Daylight, sun_position
from diagnosis.measurements.zones import latitude_of
from shared.schema import IMPOSSIBLE

FEW = 3
"""Readings of a night of which one may be wrong and their median is not."""
LEAST = 0.1
"""What is left of the twilight at its end [W/m2]: less, in half of the nights, is no offset."""
STEADY, MOST = 30.0, 0.9
"""An offset stays within this [W/m2] of its night's median, the zero offset of the coarsest class of pyranometers (ISO
9060, class C), in so many of a night's readings. The sun, under a wrong clock, does not."""
UNDER = 0.25
"""Share of the readings by day that may lie under the level of the nights by its standard deviation. Nothing is darker
than the night, and of readings of nothing but noise 16 % do."""
_HIGH = 80.0
"""Zenith [degree] below which it is day."""
_SIGMA = 1.4826
"""The standard deviation of a normal variable over its median absolute deviation."""


@dataclass(frozen=True, eq=False)
class Offset:
    """What is read in the dark of nights: from when until when [s], (nights, 2), and medians [unit of the signal]."""

    dark: np.ndarray
    values: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """The offset at times [s], one value in the dark of a night and straight lines by day, same shape."""
        return np.interp(times, self.dark.ravel(), np.repeat(self.values, 2))

    def taken_off(self, signal: Signal) -> Signal:
        """A signal without it."""
        return replace(signal, values=np.where(signal.used, signal.values - self.at(signal.middle), signal.values))

    def sentence(self, column: str, unit: str) -> str:
        """What was found."""
        low, high = float(self.values.min()), float(self.values.max())
        nights = len(self.values)
        spread = f", {low:.3g} to {high:.3g} by night" if high - low > LEAST else ""
        return (
            f"column {column}: stands at {np.median(self.values):.3g} {unit} while the sun is down (median of"
            f" {nights} night{'' if nights == 1 else 's'}{spread}): taken for the sensor's offset and subtracted"
        )


def find_offset(signal: Signal, daylight: Daylight, watt: float = 1.0) -> Offset | None:
    """The offset of an irradiance; None if it has none, or if nothing tells: no reading in the dark, or a wrong clock.

    ``watt`` is a W/m2 in the unit of the signal.
    """
    clean = signal.clean()
    if clean.kind == "hold":  # a single reading may hold all night
        times = daylight.time
        values = instants_of(clean, times)
        dark = daylight.is_dark(times)
    else:
        times, values = clean.middle, clean.values
        dark = np.all([daylight.is_dark(one) for one in (clean.begin, times, clean.end)], axis=0)
    there = np.isfinite(values)
    dark, day = dark & there, there & (daylight.zenith_at(times) < _HIGH)
    night = np.searchsorted(_dawns(daylight), times[dark])
    nights = pd.DataFrame({"night": night, "time": times[dark], "value": values[dark]}).groupby("night")
    many = nights.size().to_numpy() >= FEW
    ends = np.stack([nights["time"].min().to_numpy(), nights["time"].max().to_numpy()], axis=1)
    found = Offset(ends[many], nights["value"].median().to_numpy()[many])
    if not len(found.values):
        return None
    apart = np.abs(values[dark] - found.at(times[dark]))
    noise = _SIGMA * float(np.median(apart))
    if np.median(np.abs(found.values)) < max(LEAST * watt, noise):  # a level that its own spread hides is none
        return None
    steady = np.mean(apart <= STEADY * watt) >= MOST
    under = float(np.mean(values[day] < found.at(times[day]) - noise - 1e-9 * watt)) if day.any() else 0.0
    return found if steady and under <= UNDER else None


def _dawns(daylight: Daylight) -> np.ndarray:
    """When each night ends [s]."""
    dark = daylight.is_dark(daylight.time)
    return daylight.time[1:][dark[:-1] & ~dark[1:]]


SPARSE, LONG, IRREGULAR = 3.0, 3600.0, 0.3
"""A column read so many times less often than the file's rows, and less than hourly [s] or at spacings that differ by
this share of their mean, is logged when it changes."""
FAR = 30.0
"""Degrees of latitude that a place may lie from the town that its zone is named after: Russia's, China's and Chile's
zones reach over twenty."""
OFF = 1.75
"""Hours that a zone's standard time may differ from that of the sun: Iceland's do by one and a half."""
MANY = 24
"""Readings by day at least of which the highest tell."""
BRIDGED = 6 * 3600.0
"""A dew point or a cloud cover says little of a time so far from its readings [s]."""
COARSE_COUNT = 0.25
"""Share of the mean power from which on it matters what one count is over a step."""
FAINT = 10.0
"""Irradiance that never passes this [W/m2] is of the months without a sun."""
UNLIT, SELDOM_UNLIT = 0.03, 0.02
"""Share of a clear sky's irradiance that even the thickest cloud lets through (no hour by day has less in the years of
Greensboro and Alaska that pvlib ships), and share of readings by day that may be below it."""
DARK, BRIGHT = 0.3, 1.4
"""Shares of a clear sky's highest irradiance that the highest of some days does not stay below, nor pass."""
COARSE = 0.25
"""Share of a step from which on it matters whether readings are means or instants: as instants, means come half of
their spacing late."""
SELDOM = 1800.0
"""Irradiance that is read so many seconds apart, or more, is rarely an instant."""
CLOSES = 0.15
"""Share by which direct and diffuse irradiance together may differ from the global one: three instruments' errors."""
UTC = {"UTC", "UCT", "Z", "ZULU", "UNIVERSAL", "GMT", "GMT0", "GMT+0", "GMT-0", "GREENWICH", "+00:00", "-00:00"}
"""Its names, also with ``Etc/`` before them."""


def sparse(time: np.ndarray, readings: np.ndarray) -> float | None:
    """Usual spacing [s] of the readings of a column that is logged when it changes; None of one that is not.

    Both (rows,); NaN where a row has no reading.
    """
    there = np.isfinite(readings)
    if there.sum() < 2:
        return None
    usual, rows = usual_interval(time, there), float(np.median(np.diff(time)))
    spacing = np.diff(time[there])
    unlike = float(spacing.std()) > IRREGULAR * float(spacing.mean())
    return usual if usual > SPARSE * rows and (usual > LONG or unlike) else None


def about_changes(column: str, kind: str, usual: float) -> str:
    """What is said of such a column where nothing says how its readings are to be understood."""
    return (
        f"column {column}: read every {usual / 3600:.3g} h only, and taken for reading = {kind!r}; is it logged when it"
        " changes (reading = 'hold')?"
    )


def about_hold(column: str, signal: Signal) -> str | None:
    """What is said of a state for which nothing says how long it holds."""
    clean = signal.clean()
    if signal.kind != "hold" or len(clean.values) < 2:
        return None
    open_for = clean.begin[1:] - clean.end[:-1]
    gaps = open_for > 1.0
    left = f", {int(gaps.sum())} gaps of {open_for[gaps].sum() / 3600:.3g} h in all are left" if gaps.any() else ""
    if signal.holds >= DAY:
        longest = float((clean.end - clean.begin).max()) / 3600
        return f"column {column}: taken for logged when it changes: readings hold for up to {longest:.3g} h{left}"
    return (
        f"column {column}: taken for read all the time: a reading holds for {signal.holds / 3600:.3g} h at most{left}"
        f"{'; max_gap says otherwise' if left else ''}"
    )


def about_impossible(column: str, signal: Signal, source: Source, low: float, high: float) -> str | None:
    """A sentence if readings were left out as impossible, and what sets other limits than ``low`` to ``high``.

    These are in the column's unit, and so is what ``valid`` says.
    """
    count = int(((signal.flags & IMPOSSIBLE) > 0).sum())
    if not count:
        return None
    sets = "" if source.valid is not None else "; valid = [lowest, highest] says what else is possible"
    codes = "" if source.valid is not None else ", or codes of nines"
    limits = {
        (True, True): f"not {low:.4g} to {high:.4g} {source.unit}",
        (True, False): f"below {low:.4g} {source.unit}",
        (False, True): f"above {high:.4g} {source.unit}",
        (False, False): "no numbers of a sensor",
    }[bool(np.isfinite(low)), bool(np.isfinite(high))]
    return f"column {column}: {count} of {len(signal.values)} readings are left out: {limits}{codes}{sets}"


def without_impossible(name: str, made: Signal) -> tuple[Signal, str | None]:
    """What was computed for ``name``, marked where no reading of it could be so, and a sentence if there is some."""
    low, high, _ = units.limits("", made.unit)
    bad = made.used & ((made.values < low) | (made.values > high))
    if not bad.any():
        return made, None
    said = (
        f"{name}: {int(bad.sum())} of {len(bad)} computed values, up to {made.values[bad].max():.4g} {made.unit}, are"
        f" left out: not {low:g} to {high:g} {made.unit}; the irradiance does not go with the sun's height: check"
        " time.zone, stamps and place"
    )
    return replace(made, flags=made.flags | np.where(bad, IMPOSSIBLE, 0).astype(np.int8)), said


def about_presence(name: str, column: str, signal: Signal, most: int) -> str | None:
    """A sentence if a count of up to ``most`` persons is never but 0 or 1: it may be whether anybody is there."""
    seen = set(np.unique(signal.clean().values))
    if most <= 1 or seen != {0.0, 1.0}:
        return None
    return (
        f"{name}: column {column} holds only 0 and 1, taken for a count, and the description has up to {most} persons;"
        " is it presence? then write unit = 'presence' and persons = how many it stands for"
    )


def about_noise(column: str, signal: Signal) -> str | None:
    """A sentence if readings below what is possible were kept as noise."""
    values = signal.clean().values
    low = values[values < signal.floor]
    if not low.size:
        return None
    return (
        f"column {column}: {low.size} readings below {signal.floor:g} {signal.unit}, down to {low.min():.3g}, are taken"
        " for the meter's noise and kept in its means"
    )


def about_floor(name: str, low: np.ndarray, mean: float, raised: float, unit: str) -> str:
    """What is said of an input that noise takes to impossible values in some steps ``low``, which were raised."""
    return (
        f"{name}: {int(low.sum())} of {len(low)} steps are below what is possible by noise, and raised to it: the mean"
        f" of all is {raised:.4g} {unit}, and was {mean:.4g}"
    )


def about_register(column: str, signal: Signal) -> str | None:
    """A sentence if a power never falls: it may be a meter's register."""
    clean = signal.clean()
    values = clean.values
    if not is_register(values) or clean.end[-1] - clean.begin[0] < 86400.0:
        return None
    return (
        f"column {column}: hardly ever falls, from {values[0]:.6g} to {values[-1]:.6g} {signal.unit}; if it is a"
        " meter's register, write reading = 'register' and the unit of what it counts, as 'kWh'"
    )


def about_coarse(column: str, signal: Signal, step: float) -> str | None:
    """A sentence if one count of a register is much beside what it counts in a step [s]."""
    clean = signal.clean()
    energy = clean.values * (clean.end - clean.begin)
    least, mean = float(energy[energy > 0].min(initial=np.inf)), float(energy.sum() / (clean.end - clean.begin).sum())
    if not COARSE_COUNT * mean < least / step < np.inf:
        return None
    return (
        f"column {column}: one count of the register is {least / step:.3g} {signal.unit} over a step of {step:g} s, and"
        f" its mean is {mean:.3g} {signal.unit}: steps are coarse; longer ones (grid.step) are less so"
    )


def about_instants(name: str, apart: float, step: float) -> str | None:
    """A sentence if means over a step [s] are made of readings so far apart [s] that it matters what they are."""
    if apart < COARSE * step * (1 - 1e-6):
        return None
    return (
        f"{name}: instants {apart:g} s apart are interpolated to means over {step:g} s; if the logger wrote"
        f" means, write reading = 'mean' under variables.{name}"
    )


def about_sun(where: str, signal: Signal) -> str | None:
    """A sentence if irradiance that nobody says how to read comes so seldom that it may be means, and late as instants.

    Not of the one on the horizontal: the sun tells how late that is.
    """
    times = signal.clean().middle
    apart = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    if signal.kind != "point" or apart < SELDOM:
        return None
    return (
        f"{where}: irradiance read {apart:g} s apart is taken for instants; if the logger wrote means, write reading ="
        f" 'mean' there: as instants they come {apart / 120:g} min late"
    )


def about_helper(name: str, column: str, signal: Signal, times: np.ndarray) -> str | None:
    """A sentence if a quantity that only helps to compute another one is far from many of its ``times`` [s].

    Where that other one has no readings itself nothing is computed.
    """
    clean = signal.clean()
    if len(clean.values) < 2:
        return None
    k = np.clip(np.searchsorted(clean.middle, times, side="right") - 1, 0, len(clean.values) - 2)
    apart = clean.middle[k + 1] - clean.middle[k]
    within = (apart > BRIDGED) & (times > clean.middle[k]) & (times < clean.middle[k + 1])
    if not within.any():
        return None
    return (
        f"{name}: in {within.mean():.1%} of its readings column {column}, which it is computed with, has gaps of up to"
        f" {apart[within].max() / 3600:.3g} h, which are interpolated"
    )


def about_zone(clock: Clock, place: Place | None) -> str | None:
    """A sentence if the recording's standard time cannot be that of the place."""
    if clock.zone.upper().removeprefix("ETC/") in UTC:
        return (
            f"time.zone is {clock.zone}: days, schedules and habits of the recording run by it; expected the place's"
            " zone, with stamps = 'UTC' where the logger keeps UTC"
        )
    if place is None:
        return None
    where = latitude_of(clock.zone)
    if where is not None and abs(where - place.latitude) > FAR:
        turned = " (south is negative)" if abs(where + place.latitude) <= FAR else ""
        return (
            f"place has latitude {place.latitude:g}, and the town of zone {clock.zone} lies at {where:.0f}: check"
            f" place.latitude{turned} and time.zone, which may be an offset such as '+01:00'"
        )
    off = (clock.offset / 3600.0 - place.longitude / 15.0 + 12.0) % 24.0 - 12.0
    if abs(off) <= OFF:
        return None
    return (
        f"standard time of {clock.zone} is {abs(off):.1f} h {'ahead of' if off > 0 else 'behind'} the sun at longitude"
        f" {place.longitude:g}: check time.zone and place"
    )


def about_closure(ghi: Signal, parts: Signal) -> str | None:
    """A sentence if direct and diffuse irradiance do not make the global one, of the readings that have all three."""
    both = np.isin(ghi.begin, parts.begin) & ghi.used
    measured, together = float(ghi.values[both].sum()), float(parts.values[np.isin(parts.begin, ghi.begin[both])].sum())
    if measured <= 0 or abs(together / measured - 1) <= CLOSES:
        return None
    return (
        f"direct and diffuse irradiance together are {together / measured:.3g} of the global one: check their units,"
        " stamps, and place"
    )


def is_light(ghi: Signal) -> bool:
    """Whether irradiance is more than the offset of a pyranometer in the dark, as in the months without a sun."""
    return float(np.quantile(ghi.clean().values, 0.98)) > FAINT


def about_dark(ghi: Signal, clock: Clock, place: Place) -> str | None:
    """A sentence if global horizontal irradiance is darker than any cloud makes it while the place has its sun."""
    times, values, clear = _by_day(ghi, clock, place)
    dark = values < UNLIT * clear
    if dark.sum() < FEW or np.mean(dark) <= SELDOM_UNLIT or len(np.unique(times[dark] // DAY)) < 2:
        return None
    return (
        f"the irradiance is dark in {np.mean(dark):.0%} of its readings with the sun over 10 degrees high at latitude"
        f" {place.latitude:g}, longitude {place.longitude:g}: check place (south and west are negative), time.zone, and"
        " the sensor"
    )


def about_level(ghi: Signal, clock: Clock, place: Place) -> str | None:
    """A sentence if global horizontal irradiance is far from what any sky lets through."""
    _, values, clear = _by_day(ghi, clock, place)
    if len(values) < MANY:
        return None
    # of the highest each: at a low sun, a hill or a late clock makes any ratio
    share = float(np.quantile(values, 0.98) / np.quantile(clear, 0.98))
    if DARK <= share <= BRIGHT:
        return None
    return f"the irradiance reaches {share:.3g} of a clear sky's in its best hours: check its unit, and place"


def _by_day(ghi: Signal, clock: Clock, place: Place) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], irradiance with the sun above 10 degree, and a clear sky's then [W/m2], (readings,) each.

    Clear sky: 910 sin(h) - 30 W/m2 (Kasten and Czeplak 1980).
    """
    clean = ghi.clean()
    zenith, _ = sun_position(clock.utc(clean.middle), place)
    up = zenith < _HIGH
    return clean.middle[up], clean.values[up], 910.0 * np.cos(np.radians(zenith[up])) - 30.0
