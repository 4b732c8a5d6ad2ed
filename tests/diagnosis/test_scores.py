"""Scores of a simulation worked by hand, and units that people read."""

import numpy as np
import pytest

from diagnosis.curves import readable
from diagnosis.scores import score


def test_a_temperature_has_no_share_of_its_mean():
    found = score(np.array([293.0, 294.0, 295.0]), np.array([292.0, 293.0, 294.0]), "K")
    assert (found.rmse, found.bias, found.cvrmse, found.nmbe) == (1.0, 1.0, None, None)


def test_scores_by_hand():
    """Both figures divide by one reading less than there are (ASHRAE Guideline 14-2014, 5.2.11.3)."""
    measured = np.array([290.0, 291.0, np.nan, 293.0])
    simulated = np.array([290.5, 291.0, 7.0, 292.0])
    found = score(measured, simulated, "W")
    assert found.rmse == pytest.approx(np.sqrt((0.25 + 1.0) / 3))
    assert found.bias == pytest.approx(0.5 / 3)
    assert found.steps == 3
    assert found.cvrmse == pytest.approx(np.sqrt(1.25 / 2) / (874 / 3))
    assert found.nmbe == pytest.approx(0.5 / 2 / (874 / 3))


def test_differences_of_temperature_stay_in_kelvin():
    swing = np.array([-0.5, 0.0, np.nan, 0.5])
    assert readable(swing, "K")[1] == "K"
    np.testing.assert_array_equal(readable(swing, "K")[0], swing)
    warm, unit = readable(np.array([293.15, np.nan]), "K")
    assert unit == "°C" and warm[0] == pytest.approx(20.0)
