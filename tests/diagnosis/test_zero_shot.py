"""What an estimator is given of a recording."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from diagnosis import residuals
from diagnosis.recording import read_recording
from diagnosis.zero_shot import estimate
from shared.errors import RecordingError
from shared.stretches import Stretch
from trainer import predict
from trainer.predicting.readings import GapError


def asked(monkeypatch, hours):
    """What an estimator of so many hours is given, which refuses all of it."""
    given = []

    def predicted(run, path):
        given.append(xr.load_dataset(path, decode_times=False))
        raise GapError(f"{path}: enough")

    encoding = SimpleNamespace(lengths=[hours], step=3600.0, recorded=["TRoo", "CO2", "TDryBul"])
    monkeypatch.setattr("trainer.load_run", lambda run: SimpleNamespace(card=SimpleNamespace(encoding=encoding)))
    monkeypatch.setattr("trainer.predict", predicted, raising=False)
    return given


@pytest.mark.parametrize("units", ["hours since 2022-02-01 00:00:00", "seconds since 2022-01-05", "s"])
def test_the_estimate_is_of_the_stretch_that_is_calibrated(default_system, tmp_path, monkeypatch, units):
    """Whatever the file counts from, and where one system of a shard has its beginning apart."""
    simulate(default_system, hours=72.0, seed=1, out=tmp_path / "one.nc")
    data = xr.load_dataset(tmp_path / "one.nc", decode_times=False).drop_vars("time_bnds")
    time = data["time"].values / (3600.0 if units.startswith("hours") else 1.0)
    data = data.assign_coords(time=("time", time, {"units": units}))
    if units == "s":
        data = data.assign(start=((), 5 * 86400.0, {"units": "s"}))
    data.to_netcdf(tmp_path / "other.nc")
    record = read_recording(tmp_path / "other.nc", default_system)
    inputs = {name: values[24:60] for name, values in record.inputs.items()}
    part = replace(record, time=record.time[24:60], outputs=record.outputs[:, 24:60], inputs=inputs)
    given = asked(monkeypatch, 36)
    with pytest.raises(RecordingError, match=r"other\.nc: enough"):
        estimate("run", part, default_system)
    np.testing.assert_array_equal(given[0]["time"].values, time[24:60])
    np.testing.assert_array_equal(given[0]["TDryBul"].values, data["TDryBul"].values[24:60])
    np.testing.assert_array_equal(given[0]["TRoo"].values, data["TRoo"].values[24:60])


def test_residuals_are_of_the_estimate_that_a_calibration_begins_with(default_system, tmp_path):
    """Columns of a logger that never read anything stand in the file; held against a file that never had them."""
    simulate(default_system, hours=72.0, seed=1, out=tmp_path / "one.nc")
    data = xr.load_dataset(tmp_path / "one.nc", decode_times=False)
    unread = [name for name in default_system.output_names if name not in ("TRoo", "CO2")]
    data.drop_vars(unread).to_netcdf(tmp_path / "two.nc")
    for name in unread:
        data[name].values[:] = np.nan
    data.to_netcdf(tmp_path / "unread.nc")
    found = residuals(default_system, tmp_path / "unread.nc", run="MixedAirCO2").parameters
    expected = predict("MixedAirCO2", tmp_path / "two.nc").predictions[0].parameters
    assert found == pytest.approx({name: one.value for name, one in expected.items()}, rel=1e-5)


def test_the_estimate_of_a_stretch_is_that_of_a_recording_of_it_alone(default_system, tmp_path, caplog):
    """Ten hours of the weather are lost: before them lie 130 h, and after them 100 h."""
    simulate(default_system, hours=240.0, seed=1, out=tmp_path / "one.nc")
    data = xr.load_dataset(tmp_path / "one.nc", decode_times=False)
    data["TDryBul"].values[130:140] = np.nan
    data.to_netcdf(tmp_path / "lost.nc")
    for number, part in ((1, slice(0, 130)), (2, slice(140, 240))):
        data.isel(time=part).to_netcdf(tmp_path / "alone.nc")
        alone = read_recording(tmp_path / "alone.nc", default_system)
        record = read_recording(tmp_path / "lost.nc", default_system, stretch=Stretch(number))
        np.testing.assert_array_equal(record.time, alone.time)
        np.testing.assert_array_equal(record.outputs, alone.outputs)
        found = estimate("MixedAirCO2", record, default_system)
        assert found == estimate("MixedAirCO2", alone, default_system)
        predicted = predict("MixedAirCO2", tmp_path / "lost.nc", stretch=Stretch(number))
        assert predicted.predictions == predict("MixedAirCO2", tmp_path / "alone.nc").predictions
    assert read_recording(tmp_path / "lost.nc", default_system).time[0] == 3600.0  # the longest
    assert "has 2 stretches without gaps in TDryBul" in caplog.text


def test_a_recording_of_which_most_is_missing_is_not_made_up(default_system, tmp_path):
    """Three hours of four are as lost as three days of four, and the estimator refuses the file by itself."""
    simulate(default_system, hours=168.0, seed=1, out=tmp_path / "one.nc")
    record = read_recording(tmp_path / "one.nc", default_system)
    shown = record.outputs.copy()
    shown[:2, np.arange(shown.shape[1]) % 4 != 0] = np.nan
    with pytest.raises(RecordingError, match=r"one\.nc: TRoo has 126 missing values in its last 168 samples"):
        estimate("MixedAirCO2", replace(record, outputs=shown), default_system)


def test_what_was_put_in_is_told_and_an_old_outage_does_not_hinder(default_system, tmp_path, caplog):
    """Days with most readings lost, then three with two of the weather: these are read as if nothing were missing."""
    simulate(default_system, hours=168.0, seed=1, out=tmp_path / "one.nc")
    data = xr.load_dataset(tmp_path / "one.nc", decode_times=False)
    temperature = data["TDryBul"].values
    temperature[150:152] = np.interp([150, 151], [149, 152], temperature[[149, 152]])
    data.to_netcdf(tmp_path / "filled.nc")
    record = read_recording(tmp_path / "filled.nc", default_system)
    parts = {name: values[96:] for name, values in record.inputs.items()}
    last = replace(record, time=record.time[96:], outputs=record.outputs[:, 96:], inputs=parts)
    temperature[150:152] = np.nan
    data["CO2"].values[np.flatnonzero(np.arange(96) % 4)] = np.nan
    data.to_netcdf(tmp_path / "lost.nc")
    outputs = record.outputs.copy()
    outputs[:, 120] = np.nan
    expected = estimate("MixedAirCO2", replace(last, outputs=outputs[:, 96:]), default_system)
    assert "filled.nc: the estimator interpolated 4 readings that were lost singly" in caplog.text
    outputs[default_system.output_names.index("CO2"), np.flatnonzero(np.arange(96) % 4)] = np.nan
    found = estimate("MixedAirCO2", replace(record, outputs=outputs, path=tmp_path / "lost.nc"), default_system)
    assert found == pytest.approx(expected, rel=1e-4)
    assert "lost.nc: for the estimator, readings were interpolated: " in caplog.text
    assert "did not read a longer window" in caplog.text and "CO2 has 73 missing" in caplog.text
