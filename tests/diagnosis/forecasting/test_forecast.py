"""Forecasts of a second system."""

import pytest

from diagnosis.forecasting.forecast import forecast
from shared.errors import RecordingError


@pytest.mark.slow
def test_a_house_is_forecast_within_its_noise(house, house_recording, tmp_path):
    done = forecast(
        house("me"), house_recording(hours=192), context=96, ahead=96, starts=1, draws=15, out=tmp_path / "ahead"
    )
    ahead = done.report.outputs["room"]
    assert ahead.rmse < 0.1  # the sensor's own noise is 0.05
    assert ahead.covered > 0.7
    assert sorted(one.name for one in (tmp_path / "ahead").iterdir()) == ["forecast.html", "forecast.json"]


def test_a_recording_that_ends_too_early_is_told(house, house_recording):
    with pytest.raises(RecordingError, match="is 72 h long; expected at least 504 h"):
        forecast(house("me"), house_recording(hours=72))
