"""Forecasts of a second system."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.calibrating.calibration import calibrate
from diagnosis.forecasting.forecast import band, forecast
from diagnosis.recording import read_recording
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


@pytest.mark.slow
def test_a_calibration_from_a_file_has_the_bands_of_one_that_was_just_made(house, house_recording, tmp_path):
    """Readings far noisier than the description's floor: their noise is the calibration's, also from its file."""
    system, path = house("me"), house_recording(hours=192, noise=0.4)
    record = read_recording(path, system)
    inputs = {name: values[:96] for name, values in record.inputs.items()}
    first = replace(record, time=record.time[:96], outputs=record.outputs[:, :96], inputs=inputs)
    calibrate(system.with_experiment(hours=96.0), first, starts=1, out=tmp_path / "calibration")
    common = {"context": 96, "ahead": 96, "starts": 1, "draws": 15}
    fresh = forecast(system, path, **common)
    again = forecast(system, path, calibration=tmp_path / "calibration", **common)
    np.testing.assert_allclose(again.high - again.low, fresh.high - fresh.low, rtol=1e-3)
    assert again.report.outputs["room"].covered > 0.8
    with pytest.raises(RecordingError, match=r"was made with persons measured, which makes 4 unknowns; .* has 5, with"):
        forecast(system, path, calibration=tmp_path / "calibration", occupancy="unknown", **common)
