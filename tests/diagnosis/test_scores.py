"""Scores of a simulation worked by hand."""

import numpy as np
import pytest

from diagnosis.scores import guideline14, score, shares


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


@pytest.mark.parametrize("unit", ["K", "degC"])
def test_a_temperature_has_no_share_of_its_mean(unit):
    found = guideline14("T", unit, np.array([293.0, 294.0, 295.0]), np.array([1.0, 1.0, 1.0]))
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


@pytest.mark.parametrize("unit", ["K", "degC", "degF"])
def test_scores_of_a_temperature_are_in_its_unit_only(unit):
    found = score(np.array([20.0, 22.0, 25.0]), np.array([21.0, 23.0, 26.0]), unit)
    assert (found.rmse, found.bias, found.cvrmse, found.nmbe) == (1.0, -1.0, None, None)


def test_a_report_and_a_calibration_say_the_same_of_one_series():
    rng = np.random.default_rng(0)
    measured, simulated = 500 + rng.standard_normal((2, 50))
    one, other = score(measured, simulated, "ppm"), guideline14("CO2", "ppm", measured, measured - simulated)
    assert (one.rmse, one.bias, one.cvrmse, one.nmbe) == (other.rmse, other.bias, other.cvrmse, other.nmbe)


@pytest.mark.parametrize(("measured", "unit"), [([5.0], "W"), ([-1.0, 1.0], "W")])
def test_where_there_is_nothing_to_share_there_is_no_share(measured, unit):
    found = score(np.array(measured), np.zeros(len(measured)), unit)
    assert (found.cvrmse, found.nmbe) == (None, None)


@pytest.mark.parametrize("unit", ["K", "degC", "degF", "°C", "Celsius", "C"])
def test_no_spelling_of_a_temperature_has_shares(unit):
    measured = np.array([20.0, 21.0, 22.0])
    assert shares(measured, measured - 20.0, unit) == (None, None)
