"""Residuals by how fast they change: slow trend, diurnal, hours, fast; the parts add up to the whole."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from diagnosis.where.series import HOUR

WHOLE = "all"
EDGES = {"slow": 48 * HOUR, "diurnal": 9 * HOUR, "hours": 3 * HOUR, "fast": 0.0}
"""Shortest period of each band [s]; at an edge a band passes half the amplitude. The 12-hour harmonic is diurnal."""
MEANING = {
    WHOLE: "all periods",
    "slow": "periods of more than 2 days",
    "diurnal": "periods of 9 hours to 2 days",
    "hours": "periods of 3 to 9 hours",
    "fast": "periods of less than 3 hours",
}
BRIEF = {WHOLE: "all", "slow": "> 2 d", "diurnal": "9 h-2 d", "hours": "3-9 h", "fast": "< 3 h"}


def band_names(step: float, steps: int) -> list[str]:
    """Bands that a record of ``steps`` steps of ``step`` seconds can show, with the whole first."""
    edges = [name for name, edge in EDGES.items() if 2 * step < edge < step * steps / 2]
    names = [WHOLE, *edges]
    rest = list(EDGES)[list(EDGES).index(edges[-1]) + 1] if edges else None
    if rest is not None:
        names.append(rest)
    return names


def split(values: np.ndarray, step: float) -> dict[str, np.ndarray]:
    """Split series into bands by differences of Gaussian averages over what is there.

    A Gaussian of standard deviation P sqrt(2 ln 2) / (2 pi) halves the amplitude at period P (its frequency response
    is exp(-(2 pi sigma / P)^2 / 2)).

    Parameters
    ----------
    values
        Shape (..., steps); NaN where missing. Averages skip it and it stays missing in every band.
    step
        [s]

    Returns
    -------
    dict
        By band, each shaped like ``values``; ``all`` is the values themselves, the others add up to them.
    """
    seen = np.isfinite(values)
    filled, weight = np.where(seen, values, 0.0), seen.astype(float)
    names = band_names(step, values.shape[-1])
    bands = {WHOLE: values}
    rest = filled
    for name in names[1:-1]:
        sigma = EDGES[name] / step * np.sqrt(2 * np.log(2)) / (2 * np.pi)
        share = gaussian_filter1d(weight, sigma, axis=-1, mode="constant")
        # the seen step itself is in its own average, so that ``share`` is far from zero wherever it is used
        part = gaussian_filter1d(rest, sigma, axis=-1, mode="constant") / np.where(seen, share, 1.0)
        part = np.where(seen, part, 0.0)
        bands[name] = np.where(seen, part, np.nan)
        rest = rest - part
    if len(names) > 1:
        bands[names[-1]] = np.where(seen, rest, np.nan)
    return bands
