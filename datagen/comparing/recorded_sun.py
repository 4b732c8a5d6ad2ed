"""The sun of recorded trajectories: irradiance on a plane from columns of direct, diffuse and global irradiance.

Such columns are instants, or, as in weather files, means of the time since the row before. For a mean the sun stands
where it is in the middle of the sunlit part of that time, not where it is at the row: by the hour that is half an hour
of sun. Means become a signal as those of weather files do (:mod:`datagen.driving.weather`): each row takes the mean of
the two means that meet there, and straight lines join them.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from datagen.driving.tables import Piecewise
from datagen.driving.transposition import dates_of, irradiance_on_plane, sun_at, sunlit_middle
from shared.errors import RecordingError
from shared.signals import Table, Weather

OTHERWISE = 0.5
"""Columns that the other method fits with less than this share of the misfit are taken for the other method's."""
LEAST = 1.0
"""A misfit up to this says nothing [W/m2]."""


class Sun(Table):
    """Irradiance on the description's plane from direct normal, diffuse and global horizontal irradiance [W/m2]."""

    input: str
    dni: str
    dhi: str
    ghi: str
    method: Literal["point", "mean"] = Field(
        "point", description="of the three columns: instants, or, as in weather files, means since the row before"
    )
    latitude: float = Field(ge=-90, le=90)
    longitude: float = Field(ge=-180, le=180)
    altitude: float = 0.0
    utc_offset: float = Field(ge=-14, le=14)
    step: float = Field(900.0, gt=0, description="between the times at which the sun's position is taken [s]")

    def signal(self, plane: Weather, at: np.ndarray, dni: np.ndarray, dhi: np.ndarray, ghi: np.ndarray) -> Piecewise:
        """Irradiance on a plane [W/m2].

        ``at`` are times of the rows, evenly spaced, (rows,) [s since time zero, local standard time]; ``dni``, ``dhi``,
        ``ghi`` the columns, (rows,) each [W/m2]. Raises RecordingError if the columns are means and ``method`` says
        instants, or the other way round.
        """
        middles = self._middles(at)
        self._check(at, middles, dni, dhi, ghi)
        if self.method == "mean":
            means = irradiance_on_plane(plane, middles, dni, dhi, ghi, **self._place)
            return Piecewise(at, 0.5 * (means + np.append(means[1:], means[-1])))  # what follows the end is not known
        # the sun moves within the hours between which the irradiances are interpolated
        times = np.unique(np.concatenate([np.arange(at[0], at[-1], self.step), at]))
        dni, dhi, ghi = (np.interp(times, at, values) for values in (dni, dhi, ghi))
        return Piecewise(times, irradiance_on_plane(plane, times, dni, dhi, ghi, **self._place))

    @property
    def _place(self) -> dict[str, float]:
        return {name: getattr(self, name) for name in ("latitude", "longitude", "altitude", "utc_offset")}

    def _zenith(self, time: np.ndarray) -> np.ndarray:
        """Of the sun [degree] at times (n,) [s]."""
        place = {name: getattr(self, name) for name in ("latitude", "longitude", "altitude")}
        return sun_at(dates_of(time, self.utc_offset), **place).zenith

    def _middles(self, at: np.ndarray) -> np.ndarray:
        """The middle of the sunlit part of the time since the row before, shape (rows,) [s]."""
        step = at[1] - at[0]
        height = 90.0 - self._zenith(np.append(at[0] - step, at))
        return at + step * (sunlit_middle(height) - 1.0)

    def _check(self, at: np.ndarray, middles: np.ndarray, *columns: np.ndarray) -> None:
        """Global is diffuse plus what the sun's height leaves of the direct irradiance: that tells when the sun was."""
        misfit = {"point": self._misfit(at, *columns), "mean": self._misfit(middles, *columns)}
        here, other = misfit[self.method], misfit["mean" if self.method == "point" else "point"]
        if here > LEAST and other < OTHERWISE * here:
            found, row = ("means since the row before", "before") if self.method == "point" else ("instants", "at")
            raise RecordingError(
                f"recorded.sun: method is {self.method!r}, but columns {self.dni!r}, {self.dhi!r} and {self.ghi!r} are"
                f" {found}: {self.ghi!r} is the other two's to {other:.1f} W/m2 rms with the sun {row} the row, and to"
                f" {here:.1f} W/m2 as given; expected method = {'mean' if self.method == 'point' else 'point'!r}"
            )

    def _misfit(self, time: np.ndarray, dni: np.ndarray, dhi: np.ndarray, ghi: np.ndarray) -> float:
        """Root mean square of global less diffuse less direct irradiance on the horizontal [W/m2]."""
        zenith = np.radians(self._zenith(time))
        return float(np.sqrt(np.mean((ghi - dhi - dni * np.maximum(np.cos(zenith), 0.0)) ** 2)))
