import numpy as np
import pytest

from diagnosis.where.guideline14 import guideline14


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


@pytest.mark.parametrize("unit", ["K", "degC"])
def test_a_temperature_has_no_share_of_its_mean(unit):
    found = guideline14("T", unit, np.array([293.0, 294.0, 295.0]), np.array([1.0, 1.0, 1.0]))
    assert (found.cvrmse, found.nmbe, found.within) == (None, None, None)
    assert (found.rmse, found.bias) == (1.0, 1.0)
