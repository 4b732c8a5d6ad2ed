"""Recordings as they are read."""

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from diagnosis.recording import HOUR, read_recording
from shared.errors import RecordingError
from shared.stretches import Stretch


@pytest.mark.parametrize(
    ("units", "per_unit", "zero"),
    [
        ("hours since 2022-02-01 00:00:00", 3600.0, "2022-01-03T00:00:00"),  # as xarray saves what it was given
        ("seconds since 2022-02-02 12:00:00", 1.0, "2022-01-03T00:00:00"),  # a Wednesday noon is no time zero
    ],
)
def test_a_recording_keeps_its_dates_in_whatever_units(default_system, tmp_path, units, per_unit, zero):
    data = simulate(default_system, hours=3.0, seed=1)
    first = np.datetime64("2022-02-03T08:00:00")
    counted = np.datetime64(units.partition(" since ")[2].replace(" ", "T"))
    since = (first - counted) / np.timedelta64(1, "s") + 3600.0 * np.arange(3)
    data = data.drop_vars("time_bnds").assign_coords(time=("time", since / per_unit, {"units": units}))
    data.to_netcdf(tmp_path / "other.nc")
    found = read_recording(tmp_path / "other.nc", default_system)
    assert (str(found.zero), found.step) == (zero, 3600.0)
    assert found.zero + found.time.astype("timedelta64[s]")[0] == first
    assert found.time[0] % 86400 == 8 * 3600.0
    assert found.time[0] // 86400 % 7 == 3  # a Thursday


@pytest.mark.parametrize(("units", "minutes"), [("hours since 1900-01-01", 60), ("days since 1900-01-01", 5)])
def test_times_that_are_rounded_are_whole_steps_apart(default_system, tmp_path, units, minutes):
    """Numbers of days since 1900 tell no instant to a microsecond; four weeks of five minutes add that up."""
    data = simulate(default_system, hours=3.0, seed=1)
    steps, step = 28 * 24 * 60 // minutes, 60.0 * minutes
    since = (np.datetime64("2022-02-03") - np.datetime64(units[-10:])) / np.timedelta64(1, "s")
    time = (since + step * np.arange(1, steps + 1)) / (86400.0 if units.startswith("days") else 3600.0)
    long = data.isel(time=np.zeros(steps, dtype=int)).drop_vars("time_bnds")
    for one in long.data_vars.values():
        if one.attrs.get("cell_methods", "").startswith("time: mean"):
            one.attrs["cell_methods"] = f"time: mean (interval: {minutes} min)"
    long.assign_coords(time=("time", time, {"units": units})).to_netcdf(tmp_path / "long.nc")
    found = read_recording(tmp_path / "long.nc", default_system)
    assert found.step == step
    assert found.start + steps * found.step == pytest.approx(found.stop, rel=0, abs=1e-9 * step)
    first = found.zero + np.timedelta64(round(found.time[0]), "s")
    assert first == np.datetime64("2022-02-03") + np.timedelta64(round(step), "s")


MEAN, INSTANT = "a mean over each step", "an instant at each step's end"


@pytest.mark.parametrize(
    ("name", "said", "sentence"),
    [
        ("TRoo", "time: mean", f"'TRoo' is {MEAN} .* it is {INSTANT}"),
        ("QHea", "time: point (interval: 1 h)", f"'QHea' is {INSTANT} .* it is {MEAN}"),
    ],
)
def test_a_mean_is_not_taken_for_an_instant(default_system, tmp_path, name, said, sentence):
    data = simulate(default_system, hours=3.0, seed=1)
    data[name].attrs["cell_methods"] = said
    data.to_netcdf(tmp_path / "other.nc")
    with pytest.raises(RecordingError, match=sentence):
        read_recording(tmp_path / "other.nc", default_system)


def test_a_series_that_never_changes_is_both_its_instants_and_its_means(default_system, tmp_path):
    """A room's switch that stayed off, as another description of the same FMU records it."""
    data = simulate(default_system, hours=3.0, seed=1)
    data["yOff"].attrs["cell_methods"] = "time: mean"
    data.to_netcdf(tmp_path / "off.nc")
    np.testing.assert_array_equal(read_recording(tmp_path / "off.nc", default_system).inputs["yOff"], 0.0)
    data["yOff"].values[-1] = 1.0
    data.to_netcdf(tmp_path / "on.nc")
    with pytest.raises(RecordingError, match="'yOff' is a mean over each step"):
        read_recording(tmp_path / "on.nc", default_system)


def test_a_recording_is_read_in_stretches_and_what_is_not_needed_may_have_gaps(default_system, tmp_path):
    data = simulate(default_system, hours=120.0, seed=1)
    data["winSpe"].values[50:53] = np.nan
    data["nPer"].values[70:80] = np.nan
    data["mOA_in"].values[100:] = np.nan
    data["TRoo"].values[5:90] = np.nan  # an output is evidence, and no condition
    path = tmp_path / "gaps.nc"
    data.to_netcdf(path)

    def hours(**how):
        record = read_recording(path, default_system, **how)
        return record.start / HOUR, record.stop / HOUR, set(record.inputs) >= {"nPer"}, "mOA_in" in record.inputs

    assert hours() == (0, 50, True, True)
    assert hours(stretch=Stretch(2)) == (80, 120, True, False)
    assert hours(occupancy="unknown") == (53, 120, False, False)
    assert hours(replay=True, occupancy="unknown") == (0, 50, True, True)
    assert hours(stretch=Stretch(begin="2001-01-04")) == (80, 120, True, False)
    assert hours(stretch=Stretch(begin="2001-01-01 06:00", end="2001-01-02")) == (6, 48, True, True)
    said = "has no stretch 3; expected one of 1: 2001-01-01 00:00 to 2001-01-03 02:00"
    with pytest.raises(RecordingError, match=said):
        read_recording(path, default_system, stretch=Stretch(3))


def test_a_recording_of_another_system_is_said_to_be_one(default_system, house, tmp_path):
    simulate(default_system, hours=3.0, seed=1, out=tmp_path / "one.nc")
    with pytest.raises(RecordingError, match=r"none of .* is in it; the recording is of the system 'MixedAirCO2', and"):
        read_recording(tmp_path / "one.nc", house("me"))


def test_a_recording_of_a_newer_major_schema_is_told(default_system, tmp_path):
    """Who reads it by the rules of this one may take a mean for an instant, or a time for another."""
    data = simulate(default_system, hours=3.0, seed=1)
    data.assign_attrs(zeroshot_schema_version="3.0").to_netcdf(tmp_path / "new.nc")
    with pytest.raises(RecordingError, match=r"new\.nc: schema version is '3\.0'; .* reads up to 2: update it"):
        read_recording(tmp_path / "new.nc", default_system)


def test_a_recording_in_memory_is_the_one_in_the_file(default_system, tmp_path):
    """As xarray opens it, and as `datagen.simulate` returns it, whose times are numbers yet."""
    made = simulate(default_system, hours=48, seed=4, out=tmp_path / "room.nc")
    with xr.open_dataset(tmp_path / "room.nc") as opened:
        loaded = opened.load()
    told = read_recording(tmp_path / "room.nc", default_system)
    for given in (made, loaded, loaded.drop_encoding()):
        found = read_recording(given, default_system)
        assert (found.step, found.zero, found.assumed) == (told.step, told.zero, told.assumed)
        np.testing.assert_array_equal(found.time, told.time)
        np.testing.assert_array_equal(found.outputs, told.outputs)
        assert found.inputs.keys() == told.inputs.keys()
    assert read_recording(loaded, default_system).path == tmp_path / "room.nc"
    one, other = (read_recording(each, default_system).path.name for each in (made, made * 1.0))
    assert one.startswith("dataset-") and one != other  # called by what it holds
