"""Intervals of shares and of figures."""

import numpy as np
import pytest

from diagnosis.blind.rates import Figure, figure, share, wilson
from diagnosis.blind.score_report import by_chance as said_by_chance
from diagnosis.blind.score_report import number


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


@pytest.mark.parametrize(("hits", "n"), [(0, 3), (7, 20)])
def test_wilsons_interval_is_that_of_scipy(hits, n):
    one = share([True] * hits + [False] * (n - hits))
    assert wilson(hits / n, n) == pytest.approx((one.low, one.high), abs=1e-12)


def test_one_recording_does_not_say_how_others_would_be():
    one = figure(np.array([0.8]))
    assert one == Figure(n=1, value=0.8, low=None, high=None)
    assert (number(one), said_by_chance(one)) == ("0.8 (n = 1)", "80% (0.8 of 1)")
    two = figure(np.array([0.8, 0.4]))
    assert (two.low, two.high) == (0.4, 0.8)
