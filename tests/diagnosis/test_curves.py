"""Text in pictures is that of whoever named things."""

import numpy as np
import pytest

from diagnosis.curves import readable


def test_differences_of_temperature_stay_in_kelvin():
    swing = np.array([-0.5, 0.0, np.nan, 0.5])
    assert readable(swing, "K")[1] == "K"
    np.testing.assert_array_equal(readable(swing, "K")[0], swing)
    warm, unit = readable(np.array([293.15, np.nan]), "K")
    assert unit == "°C" and warm[0] == pytest.approx(20.0)
