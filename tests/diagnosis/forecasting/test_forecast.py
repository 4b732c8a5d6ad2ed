"""Forecasts of a second system."""

import numpy as np
import pytest

from diagnosis.forecasting.forecast import band, forecast
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


@pytest.mark.parametrize("count", [19, 20, 40])
def test_a_band_of_few_draws_holds_its_share_of_further_ones(count):
    rng = np.random.default_rng(1)
    low, high = band(rng.standard_normal((count, 60_000)))
    further = rng.standard_normal(60_000)
    assert np.mean((further > low) & (further < high)) == pytest.approx(0.9, abs=0.007)


def test_a_recording_that_ends_too_early_is_told(house, house_recording):
    with pytest.raises(RecordingError, match="is 72 h long; expected at least 504 h"):
        forecast(house("me"), house_recording(hours=72))
