"""A calibration that several tests look at."""

import pytest

from diagnosis.calibrating.calibration import calibrate
from tests.diagnosis.conftest import WARM_UP


@pytest.fixture(scope="session")
def calibrated(house, house_recorded, tmp_path_factory):
    """Two days of the house, calibrated from one start; nobody changes it."""
    recording = house_recorded(tmp_path_factory.mktemp("calibrated"), hours=48)
    return calibrate(house("me"), recording, starts=1, warm_up=WARM_UP)
