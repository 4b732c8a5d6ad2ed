"""Intervals of shares and of figures."""

import numpy as np
import pytest

from diagnosis.blind.intervals import figure, share


def test_intervals_are_wilsons_and_the_bootstraps():
    one = share([True, False])
    # by hand: n = 2, p = 1/2, z = 1.959964
    z2 = 1.959964**2
    half = 1.959964 * np.sqrt(0.25 / 2 + z2 / 16) / (1 + z2 / 2)
    assert (one.low, one.high) == pytest.approx((0.5 - half, 0.5 + half), abs=1e-6)
    assert one.low == pytest.approx(0.0945, abs=1e-4)
    assert share([]).value is None
    found = figure(np.random.default_rng(0).standard_normal(400), seed=1)
    assert found.high - found.low == pytest.approx(2 * 1.96 / 20, rel=0.1)
