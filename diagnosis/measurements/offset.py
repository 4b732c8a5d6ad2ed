"""The offset of a pyranometer: what it reads while the sun is down, found night by night and taken off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from diagnosis.measurements.grid import instants_of
from diagnosis.measurements.signal import Signal
from diagnosis.measurements.weather import Daylight

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

    Parameters
    ----------
    watt
        A W/m2 in the unit of the signal.
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
