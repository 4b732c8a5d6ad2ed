"""Scores of a simulation worked by hand."""

import numpy as np
import pytest

from diagnosis.scores import guideline14, score


def test_the_figures_of_a_case_worked_by_hand():
    measured = np.array([10.0, 12.0, 14.0, np.nan, 16.0])
    residual = measured - np.array([9.0, 13.0, 13.0, 12.0, 17.0])
    found = guideline14("QHea", "W", measured, residual)
    assert found.rmse == pytest.approx(1.0)
    assert found.bias == pytest.approx(0.0)
    assert found.cvrmse == pytest.approx(np.sqrt(4 / 3) / 13)
    assert found.nmbe == pytest.approx(0.0)
    assert found.within is True
    assert guideline14("QHea", "W", measured, residual + 3).nmbe == pytest.approx(12 / (3 * 13))
    assert guideline14("QHea", "W", measured, residual + 3).within is False
    assert guideline14("QHea", "W", measured, residual, 86400.0).within is None  # its limits are of hours


def test_a_temperature_has_no_share_of_its_mean():
    found = guideline14("T", "K", np.array([293.0, 294.0, 295.0]), np.array([1.0, 1.0, 1.0]))
    assert (found.cvrmse, found.nmbe, found.within) == (None, None, None)
    assert (found.rmse, found.bias) == (1.0, 1.0)


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
