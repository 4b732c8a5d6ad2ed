"""Hour, day and weekend of a step, by the calendar."""

import numpy as np

from tests.diagnosis.where.where_cases import HOUR, twins


def test_a_step_lies_where_its_middle_does_and_time_zero_is_a_monday():
    days = twins(outputs=1, steps=8 * 24, twins=19)
    np.testing.assert_allclose(days.hour[[0, 1, 23, 24]], [0.5, 1.5, 23.5, 0.5])
    assert days.day[[0, 23, 24, -1]].tolist() == [0, 0, 1, 7]
    # five days of 24 steps, then Saturday and Sunday
    assert np.flatnonzero(days.weekend).tolist() == list(range(120, 168))
    quarters = twins(outputs=1, steps=8, twins=19, step=HOUR / 4)
    np.testing.assert_allclose(quarters.hour[[0, 7]], [0.125, 1.875])
