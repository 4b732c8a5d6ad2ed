"""Readers of ``diagnosis`` on damaged files, and on recordings and blind sets made to do harm."""

import json

import numpy as np
import pytest
import xarray as xr

from diagnosis.blind.sealed import read_manifest
from diagnosis.measurements.mapping import load_mapping
from diagnosis.measurements.table import read_measurements
from diagnosis.recording import read_recording
from shared.errors import RecordingError
from tests.diagnosis.blind.blind_cases import Case, write_set
from tests.diagnosis.measurements.house_cases import MAPPING
from tests.hostile import cases_diagnosis
from tests.hostile.properties import property_of
from tests.trainer.conftest import tank_system

test_damaged = property_of(cases_diagnosis)


SECONDS = {"units": "seconds since 2001-01-01 00:00:00"}


def whole():
    time = ("time", 1800.0 * np.arange(1, 97), SECONDS)
    series = {name: ("time", np.ones(96), {"units": u}) for name, u in (("level", "m"), ("glow", "lx"), ("valve", "1"))}
    return xr.Dataset(series, {"time": time})


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: d.assign_coords(time=("time", np.full(96, np.nan), SECONDS)), "time has values that are not finite"),
        (lambda d: d.assign_coords(time=("time", np.arange(96.0)[::-1], SECONDS)), "runs backwards"),
        (lambda d: d.assign_coords(time=("time", np.arange(96.0))), "time has no units"),
        (lambda d: d.assign_coords(time=("time", np.arange(96.0), {"units": "h"})), "time is in 'h'"),
        (lambda d: d.drop_vars("time"), "has no coordinate 'time'"),
        (
            lambda d: d.assign(level=("time", np.array(["a"] * 96, dtype=object))).drop_vars("glow"),
            "none of the outputs",
        ),
        (
            lambda d: d.assign(valve=("time", np.full(96, np.inf), {"units": "1"})),
            r"without gaps has 0 h .valve in 96 of 96",
        ),
        (lambda d: d.expand_dims(system=2), "holds 2 systems"),
    ],
)
def test_recordings_that_make_no_sense_are_refused(tmp_path, change, sentence):
    whole().to_netcdf(tmp_path / "whole.nc")
    assert read_recording(tmp_path / "whole.nc", tank_system()).outputs.shape == (2, 96)
    change(whole()).to_netcdf(tmp_path / "r.nc")
    with pytest.raises(RecordingError, match=rf"r\.nc: .*{sentence}"):
        read_recording(tmp_path / "r.nc", tank_system())


def test_measurements_without_end_are_refused(tmp_path):
    (tmp_path / "mapping.toml").write_text(MAPPING)
    with open(tmp_path / "data.csv", "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(RecordingError, match=r"data\.csv: has 1048576 MiB"):
        read_measurements(tmp_path / "data.csv", load_mapping(tmp_path / "mapping.toml"))


@pytest.mark.parametrize("file", ["../secret", "recordings/../../secret.nc", "/etc/passwd", 3])
def test_a_blind_set_names_its_own_recordings_only(tmp_path, file):
    folder, _ = write_set(tmp_path / "set", [Case("none", truth="no_gap")])
    raw = json.loads((folder / "manifest.json").read_text())
    raw["recordings"][0]["file"] = file
    (folder / "manifest.json").write_text(json.dumps(raw))
    with pytest.raises(RecordingError, match=r"manifest\.json: recordings\.0\.file"):
        read_manifest(folder)
