"""Weather that nobody measured, from what was: sun on the facade, temperature of the sky; and the sun as a clock."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pvlib

from datagen.driving.transposition import SunPosition, sun_at, transposed
from datagen.driving.weather import cloud_factor, sky_temperature
from diagnosis.measurements.clock import Clock
from diagnosis.measurements.grid import instants_of
from diagnosis.measurements.mapping import Place
from diagnosis.measurements.signal import Signal
from shared.schema import COMPUTED
from shared.signals import Weather

_LOW = 1e-3
"""Mean sine of the sun's height below which a mean is spread evenly."""


@dataclass(frozen=True, eq=False)
class Sun:
    """Where the sun stands in each part of each interval: zenith [degree] and day of the year, (n, parts)."""

    zenith: np.ndarray
    day: np.ndarray

    @property
    def sine(self) -> np.ndarray:
        """Sine of the sun's height, zero below the horizon."""
        return np.maximum(np.cos(np.radians(self.zenith)), 0.0)

    @property
    def spread(self) -> np.ndarray:
        """What a mean on the horizontal is multiplied with in each part: in proportion to the sine."""
        mean = self.sine.mean(axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(mean > _LOW, self.sine / mean, 1.0)

    def beam(self, dni: np.ndarray) -> np.ndarray:
        """Mean direct normal irradiance (n,) in each part, of those in which the sun is up [W/m2]."""
        up = self.sine > 0
        share = up.mean(axis=1, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(up, dni[:, None] / share, 0.0)

    def clear(self) -> np.ndarray:
        """Direct normal irradiance that a clear sky lets through [W/m2] (Meinel and Meinel 1976)."""
        airmass = pvlib.atmosphere.get_relative_airmass(self.zenith)
        extra = pvlib.irradiance.get_extra_radiation(self.day.ravel()).reshape(self.day.shape)
        return np.where(np.isfinite(airmass), extra * 0.7 ** (np.nan_to_num(airmass) ** 0.678), 0.0)


def closed(dni: np.ndarray, dhi: np.ndarray, sun: Sun) -> np.ndarray:
    """Mean global horizontal irradiance (n,) of measured direct normal and diffuse horizontal [W/m2]."""
    return np.asarray((sun.beam(dni) * sun.sine).mean(axis=1) + dhi)


def split(
    ghi: np.ndarray, sun: Sun, dni: np.ndarray | None = None, dhi: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Global, direct normal and diffuse irradiance [W/m2] in each part, (n, parts).

    With both of direct and diffuse measured they are taken as they are; with one of them the other closes the global,
    for a diffuse one at a low sun within what a clear sky lets through, as pvlib has it. Where neither has a value, by
    Erbs et al. (1982), whose direct part is never more than that: a reading that is late or early at a low sun would
    become a beam.

    Parameters
    ----------
    ghi
        Means on the horizontal, not negative, shape (n,) [W/m2].
    dni, dhi
        The same of direct normal and diffuse horizontal irradiance, NaN where there is none.
    """
    total = ghi[:, None] * sun.spread
    nothing = np.full(len(ghi), np.nan)
    dni, dhi = (nothing if one is None else np.maximum(one, 0.0) for one in (dni, dhi))
    beam, sky = sun.beam(dni), np.minimum(dhi, ghi)[:, None] * sun.spread
    usual = np.asarray(pvlib.irradiance.erbs(total.ravel(), sun.zenith.ravel(), sun.day.ravel())["dni"])
    clear = sun.clear()
    flat = (pd.Series(one.ravel()) for one in (total, sky, sun.zenith, clear))
    closing = np.nan_to_num(pvlib.irradiance.dni(*flat, zenith_threshold_for_zero_dni=90.0).to_numpy())
    has_dni, has_dhi = np.isfinite(dni)[:, None], np.isfinite(dhi)[:, None]
    computed = np.where(has_dhi, closing.reshape(total.shape), np.minimum(usual.reshape(total.shape), clear))
    with np.errstate(invalid="ignore", divide="ignore"):
        most = np.where(sun.sine > 0, total / sun.sine, 0.0)
    direct = np.where(has_dni, np.where(has_dhi, beam, np.minimum(beam, most)), computed)
    diffuse = np.where(has_dni & has_dhi, dhi[:, None] * sun.spread, total - direct * sun.sine)
    return total, direct, diffuse


_FINEST = 300.0
"""Means are split into parts of at most this length for the sun's movement within them [s]."""
_BESIDE = 5 * 3600.0
"""The sun is known so long before and after a record [s]."""
_DARK = 96.0
"""Zenith [degree] from which on civil twilight is over: what light is left is below 0.1 W/m2."""
_HIGH = 80.0
"""Zenith [degree] below which a sky under any cloud sends tens of W/m2, whose course no sensor misses."""
_SWINBANK = 9.365e-6
"""Clear-sky emissivity over the square of the air temperature [1/K2] (Swinbank 1963)."""
_SKY_BELOW_AIR = 11.0
"""How far the sky is below the air in intermediate climates [K] (EN ISO 13790, section 11.3.3)."""


def sun_position(utc: np.ndarray, place: Place) -> tuple[np.ndarray, np.ndarray]:
    """Apparent zenith and azimuth of the sun [degree] at UTC [s since 1970], same shape."""
    index = pd.to_datetime(np.asarray(utc, dtype=np.float64).ravel(), unit="s", utc=True)
    found = sun_at(index, latitude=place.latitude, longitude=place.longitude, altitude=place.altitude)
    return found.zenith.reshape(np.shape(utc)), found.azimuth.reshape(np.shape(utc))


@dataclass(frozen=True, eq=False)
class Daylight:
    """The sun's apparent zenith [degree] at times of the clock, both (n,), close enough for straight lines [s]."""

    time: np.ndarray
    zenith: np.ndarray

    @classmethod
    def over(cls, begin: float, end: float, clock: Clock, place: Place) -> Daylight:
        """Of a span of the clock [s], and five hours to both sides."""
        time = np.arange(begin - _BESIDE, end + _BESIDE + _FINEST, _FINEST)
        return cls(time, sun_position(clock.utc(time), place)[0])

    def zenith_at(self, times: np.ndarray) -> np.ndarray:
        """The zenith [degree] at times [s], same shape."""
        return np.interp(times, self.time, self.zenith)

    def is_dark(self, times: np.ndarray) -> np.ndarray:
        """Whether no light of the sun is left, civil twilight being over, at times [s], same shape."""
        return self.zenith_at(times) > _DARK

    def lit(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """How long the sun stands high enough between two times to show through any cloud [s], same shape."""
        high = np.concatenate([[0.0], np.cumsum(_FINEST * (self.zenith[:-1] < _HIGH))])
        return np.interp(end, self.time, high) - np.interp(begin, self.time, high)


def on_the_plane(
    ghi: Signal,
    clock: Clock,
    place: Place,
    plane: Weather,
    *,
    dni: np.ndarray | None = None,
    dhi: np.ndarray | None = None,
) -> Signal:
    """Global horizontal irradiance to a tilted plane [W/m2].

    Split into direct and diffuse by what was measured of them (``dni``, ``dhi``, (n,), NaN where there is none), else
    by Erbs et al. (1982; :mod:`diagnosis.measurements.weather`), carried to the plane by the description's
    transposition model, both as pvlib has them. A mean is spread over its interval in proportion to the sine of the
    sun's height first, so that sunrise, sunset and long intervals get the sun's real direction. Erbs' correlation is of
    hourly means: at shorter steps it is used as it stands, and passing clouds make it worse.
    """
    values = np.where(np.isfinite(ghi.values), np.maximum(ghi.values, 0.0), 0.0)
    poa = np.empty(len(values))
    for some, parts in _alike(ghi):
        sun, azimuth = _sun_within(ghi, some, parts, clock, place)
        beam, sky = (None if one is None else one[some] for one in (dni, dhi))
        poa[some] = _carried(split(values[some], sun, beam, sky), sun, azimuth, plane)
    return replace(ghi, values=poa, flags=ghi.flags | np.int8(COMPUTED))


def _carried(
    parts: tuple[np.ndarray, np.ndarray, np.ndarray], sun: Sun, azimuth: np.ndarray, plane: Weather
) -> np.ndarray:
    """Mean irradiance of a tilted plane (n,) of global, direct normal and diffuse one in parts (n, parts) [W/m2]."""
    total, direct, diffuse = (one.ravel() for one in parts)
    carried = transposed(
        sun.day.ravel(),
        SunPosition(sun.zenith.ravel(), azimuth.ravel()),
        *(direct, diffuse, total),
        tilt=plane.surface_tilt,
        azimuth=plane.surface_azimuth,
        albedo=plane.albedo,
        model=plane.transposition,
    )
    return np.asarray(carried.reshape(sun.zenith.shape).mean(axis=1))


def global_of(readings: Signal, dni: np.ndarray, dhi: np.ndarray, clock: Clock, place: Place) -> Signal:
    """Global horizontal irradiance [W/m2] of direct normal and diffuse horizontal irradiance, where both are.

    ``dni`` and ``dhi`` (n,) are of the intervals or instants of ``readings``, NaN where there is none.
    """
    there = np.isfinite(dni) & np.isfinite(dhi)
    begin, end = readings.begin[there], readings.end[there]
    base = replace(readings, begin=begin, end=end, values=dhi[there], flags=np.full(there.sum(), COMPUTED, np.int8))
    beam, sky = (np.maximum(one[there], 0.0) for one in (dni, dhi))
    values = np.empty(len(begin))
    for some, parts in _alike(base):
        sun, _ = _sun_within(base, some, parts, clock, place)
        values[some] = closed(beam[some], sky[some], sun)
    return replace(base, values=values)


def _alike(signal: Signal) -> Iterator[tuple[np.ndarray, int]]:
    """Places of the readings (some,) whose intervals are split into so many parts, for each such number.

    Of a logger that writes on change one interval lasts a night and others a minute: with the parts of the longest for
    all, a year would not fit into memory.
    """
    parts = np.maximum(np.ceil((signal.end - signal.begin) / _FINEST - 1e-9), 1).astype(int)
    for count in np.unique(parts):
        yield np.flatnonzero(parts == count), int(count)


def _sun_within(signal: Signal, some: np.ndarray, parts: int, clock: Clock, place: Place) -> tuple[Sun, np.ndarray]:
    """Where the sun stands in equal parts of some readings' intervals, and its azimuth [degree], (some, parts)."""
    begin, end = signal.begin[some], signal.end[some]
    share = (np.arange(parts) + 0.5) / parts
    utc = clock.utc(begin[:, None] + share * (end - begin)[:, None])
    zenith, azimuth = sun_position(utc, place)
    day = pd.to_datetime(utc.ravel(), unit="s").day_of_year.to_numpy().reshape(utc.shape)
    return Sun(zenith, day), azimuth


def cloud_cover(ghi: Signal, clock: Clock, place: Place) -> tuple[np.ndarray, np.ndarray]:
    """Cloud cover of each day from its irradiance (Kasten and Czeplak 1980), sun above 10 degree.

        GHI / GHI_clear = 1 - 0.75 N^3.4,   GHI_clear = 910 sin(h) - 30 W/m2

    Returns
    -------
    tuple
        Noons of the days [s] and the share of the sky covered, both (days,); empty if no day had such a sun.
    """
    clean = ghi.clean()
    zenith, _ = sun_position(clock.utc(clean.middle), place)
    sine = np.cos(np.radians(zenith))
    up = sine > np.sin(np.radians(10.0))
    day = np.floor(clean.middle / 86400.0).astype(np.int64)
    days = np.unique(day[up])
    if not days.size:
        return np.empty(0), np.empty(0)
    seen = np.array([clean.values[up & (day == one)].sum() for one in days])
    clear = np.array([(910.0 * sine[up & (day == one)] - 30.0).sum() for one in days])
    loss = np.clip((1.0 - seen / clear) / 0.75, 0.0, 1.0)
    return days * 86400.0 + 43200.0, loss ** (1 / 3.4)


def sky(air: Signal, others: dict[str, Signal], clock: Clock, place: Place | None) -> tuple[Signal, str]:
    """Temperature of the sky [K] at the air temperature's readings, and a sentence on how it was estimated.

    With a dew point: Clark and Allen (1978). Without: Swinbank (1963). Clouds by Walton (1983), as weather files do
    (:func:`datagen.driving.weather.cloud_factor`), from the measured cover, else from the irradiance
    (:func:`cloud_cover`). With neither dew point nor clouds the sky is 11 K below the air (EN ISO 13790).
    """
    at = air.middle
    cover, clouds = None, "no clouds known"
    if "opaque_cover" in others:
        cover, clouds = _everywhere(others["opaque_cover"], at), "measured cloud cover"
    elif "ghi" in others and place is not None:
        noons, found = cloud_cover(others["ghi"], clock, place)
        if noons.size:
            cover = np.interp(at, noons, found)
            clouds = f"each day's cloud cover from its irradiance (Kasten and Czeplak; {found.mean():.2f} on average)"
    # what may not be used is not computed with either: its powers may not exist
    air_temperature = np.where(air.used, air.values, 283.15)
    if "temp_dew" in others:
        dew = _everywhere(others["temp_dew"], at)
        tenths = np.zeros(len(at)) if cover is None else 10.0 * cover
        values = sky_temperature({"temp_air": air_temperature, "temp_dew": dew, "opaque_cover": tenths})
        how = f"dew point (Clark and Allen) and {clouds}"
    elif cover is not None:
        emissivity = _SWINBANK * air_temperature**2 * cloud_factor(10.0 * cover)
        values = np.minimum(emissivity, 1.0) ** 0.25 * air_temperature
        how = f"air temperature (Swinbank; no dew point) and {clouds}"
    else:
        values = air_temperature - _SKY_BELOW_AIR
        how = f"air temperature less {_SKY_BELOW_AIR:g} K (EN ISO 13790; neither dew point nor clouds known)"
    return replace(air, values=values, flags=air.flags | np.int8(COMPUTED)), how


def dew_point(air: Signal, humidity: Signal) -> Signal:
    """The dew point [K] at the readings of the relative humidity, a share, by Magnus' formula (WMO-No. 8)."""
    share = np.clip(np.where(humidity.used, humidity.values, 0.5), 0.01, 1.0)
    dew = pvlib.atmosphere.tdew_from_rh(_everywhere(air, humidity.middle) - 273.15, 100.0 * share) + 273.15
    return replace(humidity, values=dew, flags=humidity.flags | np.int8(COMPUTED), unit="K")


def _everywhere(signal: Signal, times: np.ndarray) -> np.ndarray:
    """A slow quantity at any time: straight lines over its gaps, its nearest value beyond its ends."""
    found = instants_of(signal, times)
    clean = signal.clean()
    return np.where(np.isfinite(found), found, np.interp(times, clean.middle, clean.values))


def sun_clock(ghi: Signal, daylight: Daylight) -> tuple[float, float, float]:
    """How far the irradiance runs behind the sun of its place and clock: a check of stamps and zone.

    Returns
    -------
    tuple
        The shift with the highest correlation between irradiance and the sine of the sun's height [min; positive:
        the stamps are late], within 4 hours; that correlation; and the share of the irradiance with the sun down.
    """
    clean = ghi.clean()
    at = clean.middle
    height = np.maximum(np.cos(np.radians(daylight.zenith)), 0.0)
    shifts = np.arange(-240, 241, 5)
    total = float(clean.values.sum())
    if total <= 0 or clean.values.std() == 0:
        return 0.0, 0.0, 0.0
    suns = [np.interp(at - 60.0 * one, daylight.time, height) for one in shifts]
    # where it does not rise at all there is nothing to be late of
    found = [float(np.corrcoef(clean.values, sun)[0, 1]) if sun.std() > 0 else 0.0 for sun in suns]
    best = int(np.argmax(found))
    down = float(clean.values[daylight.zenith_at(at) > 92.0].sum()) / total
    return float(shifts[best]), found[best], down
