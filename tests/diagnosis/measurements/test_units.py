"""Units as people write them, against numbers known by heart, and there and back again."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.units import convert, limits
from shared.errors import RecordingError


def one(value, unit, target, density=1.2):
    return float(convert(value, unit, target, density=density, where="column"))


@pytest.mark.parametrize(
    ("value", "unit", "target", "expected"),
    [
        (20.0, "degC", "K", 293.15),
        (68.0, "degF", "K", 293.15),
        (0.042, "percent", "ppm", 420.0),
        (35.0, "%", "1", 0.35),
        (0.35, "fraction", "1", 0.35),
        (240.0, "m3/h", "kg/s", 0.08),
        (0.08, "kg/s", "m3/h", 240.0),
        (36.0, "km/h", "m/s", 10.0),
        (1.5, "kW", "W", 1500.0),
        (360.0, "J/cm2/h", "W/m2", 1000.0),
    ],
)
def test_known_conversions(value, unit, target, expected):
    assert one(value, unit, target) == pytest.approx(expected, rel=1e-12)


PAIRS = [("degC", "K"), ("degF", "K"), ("percent", "1"), ("ppm", "1"), ("m3/h", "kg/s"), ("km/h", "m/s"), ("kW", "W")]


@settings(max_examples=25)
@given(
    value=st.floats(-1e4, 1e4),
    pair=st.sampled_from(PAIRS),
    density=st.floats(0.9, 1.4),
)
def test_there_and_back(value, pair, density):
    there = one(value, *pair, density)
    assert one(there, *pair[::-1], density) == pytest.approx(value, rel=1e-9, abs=1e-7)


@pytest.mark.parametrize(
    ("unit", "target", "said"),
    [
        ("degC", "ppm", "'degC' cannot become 'ppm'"),
        ("C", "K", "'C' is coulomb, write 'degC'"),
        ("DegC", "K", "unit 'DegC' is not known.*; did you mean 'degC'\\?"),
        ("people", "1", "unit 'people' is not known.*; did you mean 'persons'\\?"),
    ],
)
def test_units_that_do_not_fit(unit, target, said):
    with pytest.raises(RecordingError, match=said):
        one(1.0, unit, target)


def test_every_unit_of_flow_has_the_limit_of_mass_flows():
    """1 g/s of air of 1.2 kg/m3 is 3 m3/h."""
    assert limits("", "m3/h") == (pytest.approx(-3.0), np.inf, "noise")
    assert limits("", "m3/h", density=1.0)[0] == pytest.approx(-3.6)
    assert limits("", "l/s") == (pytest.approx(-1 / 1.2), np.inf, "noise")
    assert limits("", "kg/h") == (pytest.approx(-3.6), np.inf, "noise")
    assert limits("", "kg/s") == (-1e-3, np.inf, "noise")
    assert limits("", "no such unit") == limits("", "W") == (-np.inf, np.inf, "impossible")
