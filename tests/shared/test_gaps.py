"""Bridges over short gaps, against a straight line through their ends."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shared.stretches import bridge


def test_short_inner_gaps_are_bridged_and_no_others():
    nan = np.nan
    values = np.array([nan, 1.0, nan, 3.0, nan, nan, 0.0, nan, nan, nan, 4.0, nan])
    filled = bridge(values, 2)
    np.testing.assert_allclose(values, [nan, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, nan, nan, nan, 4.0, nan])
    assert np.flatnonzero(filled).tolist() == [2, 4, 5]


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.integers(0, 6))
def test_a_straight_line_is_itself_again_wherever_something_is_put_in(missing, longest):
    line = 3.0 - 0.5 * np.arange(len(missing))
    values = np.where(missing, np.nan, line)
    before = np.isnan(values)
    filled = bridge(values, longest)
    np.testing.assert_allclose(values[~np.isnan(values)], line[~np.isnan(values)])
    assert (filled == (before & ~np.isnan(values))).all()
