"""Measured direct and diffuse irradiance on a facade, against pvlib's transposition of what made them up."""

from itertools import combinations

import numpy as np
import pvlib
import pytest

from diagnosis.measurements.weather import global_of, on_the_plane
from tests.diagnosis.measurements.test_weather import CLOCK, PLACE, SOUTH, clear_days, means

# Tuples, not sets: the tests are named after them, and workers that collect tests must agree on the names.
COMBINATIONS = [some for count in (1, 2, 3) for some in combinations(("ghi", "dni", "dhi"), count)]


def broken_clouds(step):
    """Three days whose beam is between none and all of a clear sky's, unlike Erbs' mean sky: parts, and on a facade."""
    clear, sun = clear_days()
    rng = np.random.default_rng(2)
    through = np.repeat(rng.choice([0.0, 0.4, 1.0], len(clear) // 12), 12)
    sine = np.maximum(np.cos(np.radians(sun["apparent_zenith"].to_numpy())), 0.0)
    dni, dhi = clear["dni"].to_numpy() * through, clear["dhi"].to_numpy() * (1.5 - 0.5 * through)
    ghi = dni * sine + dhi
    facade = pvlib.irradiance.get_total_irradiance(
        90, 180, sun["apparent_zenith"], sun["azimuth"], dni, ghi, dhi, albedo=0.2, model=SOUTH.transposition,
        dni_extra=pvlib.irradiance.get_extra_radiation(sun.index),
        airmass=pvlib.atmosphere.get_relative_airmass(sun["apparent_zenith"]),
    )["poa_global"].fillna(0)  # fmt: skip
    parts = {"ghi": ghi, "dni": dni, "dhi": dhi}
    return {k: one.reshape(-1, step // 300).mean(axis=1) for k, one in parts.items()}, facade.to_numpy().reshape(
        -1, step // 300
    ).mean(axis=1)


def carried(parts, names, plane, step):
    """On the plane from those of the parts that are named."""
    signals = {name: means(parts[name], step) for name in names}
    if "ghi" in names:
        ghi = signals.pop("ghi")
    else:
        ghi = global_of(signals["dhi"], signals["dni"].values, signals["dhi"].values, CLOCK, PLACE)
    return on_the_plane(ghi, CLOCK, PLACE, plane, **{name: one.values for name, one in signals.items()}).values


@pytest.mark.parametrize("names", [one for one in COMBINATIONS if len(one) > 1], ids="-".join)
def test_a_facade_gets_what_was_measured_of_the_sun(names):
    """Erbs' mean sky misses these hours by a tenth and more of their mean; measured parts do not."""
    step = 3600
    parts, truth = broken_clouds(step)
    erbs = np.sqrt(np.mean((carried(parts, {"ghi"}, SOUTH, step) - truth) ** 2))
    found = np.sqrt(np.mean((carried(parts, names, SOUTH, step) - truth) ** 2))
    assert erbs > 0.1 * truth.mean()
    assert found < 0.25 * erbs
    assert carried(parts, names, SOUTH, step).mean() == pytest.approx(truth.mean(), rel=0.02)
