"""Which window of a recording is read, and what of it may be missing."""

import numpy as np
import pytest

from shared.errors import RecordingError
from trainer.cli import app
from trainer.predicting.prediction import predict
from trainer.predicting.recorded import read_window

from .conftest import write


def test_an_optional_channel_may_be_absent(flexible, recording, tmp_path):
    found = predict(flexible, write(recording, tmp_path / "r.nc"))
    assert found.absent == ["glow"]
    assert found.context_hours == 48.0  # the longest of the run's that the recording has
    values = np.full((1, 96, 2), np.nan, dtype=np.float32)
    values[0, :, 0] = recording["level"].values[-96:]
    expected = flexible.estimate(values, recording["time"].values[-96:-95].astype("M8[s]").astype(float) - 978307200)
    assert found.predictions[0].parameters["tank.drain"].value == pytest.approx(expected[0, 0])


def test_a_shorter_recording_uses_a_shorter_context(flexible, recording, tmp_path):
    short = write(recording.isel(time=slice(0, 60)), tmp_path / "r.nc")
    assert predict(flexible, short).context_hours == 24.0


def test_gaps_are_read_up_to_what_was_trained_on(flexible, recording, tmp_path):
    gappy = recording.copy(deep=True)
    gappy["level"][60:70] = np.nan
    assert predict(flexible, write(gappy, tmp_path / "some.nc")).predictions
    gappy["level"][60:90] = np.nan
    with pytest.raises(RecordingError, match=r"level has 30 missing values.*expected at most 14"):
        predict(flexible, write(gappy, tmp_path / "many.nc"))


def test_an_outage_long_ago_does_not_spoil_the_days_since(flexible, recording, tmp_path, capsys):
    alone = predict(flexible, write(recording.isel(time=slice(52, None)), tmp_path / "alone.nc"))
    recording["level"][10:45] = np.nan
    path = write(recording, tmp_path / "r.nc")
    found = predict(flexible, path)
    assert found.context_hours == 24.0 and found.predictions == alone.predictions
    assert found.passed == f"{path}: level has 35 missing values in its last 96 samples; expected at most 14: " + (
        "choose a window without (--from and --to); only an input's gaps may be filled (fill in the mapping of"
        " `diagnosis import`)"
    )
    assert app(["predict", str(flexible.folder), str(path)], result_action="return_value") in (None, 0)
    assert "A longer window was not read: " in capsys.readouterr().out
    lost = recording.isel(time=np.delete(np.arange(100), 20))  # a row that is missing spoils it no more
    assert predict(flexible, write(lost, tmp_path / "lost.nc")).predictions == alone.predictions
    assert alone.passed is None


@pytest.mark.parametrize("lost", [slice(70, 90), slice(0, 100)])
def test_an_optional_meter_that_failed_is_done_without(flexible, shard, recording, tmp_path, lost):
    without = predict(flexible, write(recording, tmp_path / "without.nc"))
    glow = shard.isel(system=4, drop=True)["glow"][:100].copy(deep=True)
    glow[lost] = np.nan
    found = predict(flexible, write(recording.assign(glow=glow), tmp_path / "r.nc"))
    assert found.absent == ["glow"] and found.predictions == without.predictions


def test_readings_that_are_missing_one_by_one_are_put_in(flexible, recording, tmp_path):
    holes = recording.copy(deep=True)
    holes["level"][50:90:10] = np.nan
    holes["level"][51] = np.nan
    holes["level"][-3:] = np.nan  # three in a row, at the end
    window = read_window(write(holes, tmp_path / "r.nc"), flexible.card.encoding)
    values = recording["level"].values[-96:].astype(np.float64)
    missing = np.isnan(holes["level"].values[-96:])
    steps = np.arange(96)
    expected = np.interp(steps, steps[~missing], values[~missing])
    expected[-3:] = np.nan
    np.testing.assert_allclose(window.values[0, :, 0], expected, rtol=1e-6)
    assert window.bridged == (5,)
    assert "the recording has gaps" in predict(flexible, tmp_path / "r.nc").rmse_note


def test_a_stamp_that_is_missing_is_a_sentence(flexible, recording, tmp_path):
    """Also of a window of one sample, in which there is no step to look at."""
    stamps = recording["time"].values.copy()
    stamps[-1] = np.datetime64("NaT")
    path = write(recording.drop_vars("time").assign_coords(time=stamps), tmp_path / "r.nc")
    encoding = flexible.card.encoding
    for lengths in ({"length": 1, "shorter": []}, {}):
        with pytest.raises(RecordingError, match=r"r\.nc: a time stamp is missing; expected one for each sample"):
            read_window(path, encoding.model_copy(update=lengths))
