"""A calibration that several tests look at."""

import pytest

from diagnosis.calibrating.calibration import calibrate


@pytest.fixture(scope="session")
def calibrated(house, house_recorded, tmp_path_factory):
    """Two days of the house, calibrated from one start; nobody changes it."""
    return calibrate(house("me"), house_recorded(tmp_path_factory.mktemp("calibrated"), hours=48), starts=1)
