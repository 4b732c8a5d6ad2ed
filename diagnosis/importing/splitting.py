"""Global irradiance split into direct and diffuse: as measured where they were, else as they usually are.

Means are spread over parts of their intervals, in which the sun has a place each; what is measured keeps its mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pvlib

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
