"""Hours of the day that cells are made of."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.where.finding import all_windows


@pytest.mark.parametrize(("hours", "lengths"), [(1, {24, 6, 1}), (4, {24, 4}), (8, {24})])
def test_a_window_holds_as_many_steps_as_any_other_of_its_length(hours, lengths):
    """A block of six hours would hold one of two steps of four hours, or both."""
    hour = (np.arange(0, 24, hours) + 0.5 * hours).repeat(7)  # a week
    residuals = SimpleNamespace(step=3600.0 * hours, time=hour, hour=hour, weekend=np.zeros(len(hour), dtype=bool))
    windows, holds = all_windows(residuals)
    assert {one.stop - one.start for one in windows} == lengths
    for length in lengths:
        of = [k for k, one in enumerate(windows) if one.stop - one.start == length and one.day_type == "any"]
        assert len(set(holds[of].sum(1))) == 1 and holds[of].sum() == len(hour)
