"""Places that a verdict names, as steps of the recording."""

import numpy as np

from diagnosis.blind.opened import steps_of


def test_cells_are_read_as_they_are_written():
    series = {"x": np.arange(48.0)}
    cell = {"hours": "06:00-12:00", "day_type": "weekend", "regime": "x high", "rule": "x > 33.5 W/m2"}
    start = 5 * 86400.0 - 86400.0  # Friday, then Saturday
    assert np.flatnonzero(steps_of(cell, start, 3600.0, 48, series)).tolist() == [34, 35]
    assert steps_of({"rule": "y > 3"}, 0.0, 3600.0, 48, series) is None
    assert steps_of({"rule": "x = 0"}, 0.0, 3600.0, 48, series).sum() == 1
    assert steps_of({"hours": "any", "day_type": "any", "rule": "always"}, 0.0, 3600.0, 48, series).all()
