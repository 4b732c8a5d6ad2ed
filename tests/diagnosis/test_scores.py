"""Scores of a simulation worked by hand."""

import numpy as np
import pytest

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
