"""Readers of ``diagnosis`` on damaged files, and on recordings and blind sets made to do harm."""

import json

import numpy as np
import pytest
import xarray as xr

from diagnosis.blind.places import inputs_of
from diagnosis.blind.score_schema import read_score
from diagnosis.blind.sealed import read_manifest
from diagnosis.calibrating.schema import read_calibration
from diagnosis.measurements.mapping import load_mapping
from diagnosis.measurements.table import read_measurements
from diagnosis.recording import read_recording
from shared.errors import RecordingError
from tests.diagnosis.blind.blind_cases import Case, write_set
from tests.diagnosis.measurements.house_cases import MAPPING, measured
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
        (lambda d: d.isel(time=[0]), "shorter than two steps"),
        (lambda d: d.drop_vars("time"), "has no coordinate 'time'"),
        (lambda d: d.assign(level=d["level"].assign_attrs(units=np.array([1.0, 2.0]))), "'level' is in"),
        (
            lambda d: d.assign(level=("time", np.array(["a"] * 96, dtype=object))).drop_vars("glow"),
            "none of the outputs",
        ),
        (
            lambda d: d.assign(valve=("time", np.full(96, np.inf), {"units": "1"})),
            r"without gaps has 0 h .valve in 96 of 96",
        ),
        (lambda d: d.assign(level=(("k", "time"), np.ones((2, 96)), {"units": "m"})), "has dimensions"),
        (lambda d: d.expand_dims(system=2), "holds 2 systems"),
    ],
)
def test_recordings_that_make_no_sense_are_refused(tmp_path, change, sentence):
    whole().to_netcdf(tmp_path / "whole.nc")
    assert read_recording(tmp_path / "whole.nc", tank_system()).outputs.shape == (2, 96)
    change(whole()).to_netcdf(tmp_path / "r.nc")
    with pytest.raises(RecordingError, match=rf"r\.nc: .*{sentence}"):
        read_recording(tmp_path / "r.nc", tank_system())


def read_house(folder, text):
    (folder / "mapping.toml").write_text(MAPPING)
    (folder / "data.csv").write_bytes(text)
    mapping = load_mapping(folder / "mapping.toml")
    found = read_measurements(folder / "data.csv", mapping)
    return found.numbers("room", "here")


@pytest.mark.parametrize(
    "text",
    [
        b"",
        b"\0" * 1000,
        b"\xff\xfe" + "when,room\n".encode("utf-16-le"),
        b"when,room\n",
        b"when\n" + b"2022-01-01\n" * 5,
        b"when,room\nnever,1\nnever,2\n",
        b"when,room\n" + b'"' * 1000,
        b"when,room\n2022-01-01 00:00,x\n2022-01-01 01:00,y\n",
        b"when,room\n2022-01-01 00:00,inf\n2022-01-01 01:00,nan\n",
        b"," * 100_000 + b"\n",
        b"\x1f\x8b\x08\x00" + bytes(100),
    ],
)
def test_measurements_that_are_none_are_refused(tmp_path, text):
    frame, _ = measured(days=1)
    assert len(read_house(tmp_path, frame.to_csv(index=False).encode())) > 100
    with pytest.raises(RecordingError, match=r"data\.csv") as caught:
        read_house(tmp_path, text)
    assert len(str(caught.value)) < 3000


def test_measurements_without_end_are_refused(tmp_path):
    (tmp_path / "mapping.toml").write_text(MAPPING)
    with open(tmp_path / "data.csv", "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(RecordingError, match=r"data\.csv: has 1048576 MiB"):
        read_measurements(tmp_path / "data.csv", load_mapping(tmp_path / "mapping.toml"))


@pytest.mark.parametrize(
    "file", ["../secret", "recordings/../../secret.nc", "/etc/passwd", "a/b/c.nc", "", "x", 3, None]
)
def test_a_blind_set_names_its_own_recordings_only(tmp_path, file):
    folder, _ = write_set(tmp_path / "set", [Case("none", truth="no_gap")])
    raw = json.loads((folder / "manifest.json").read_text())
    raw["recordings"][0]["file"] = file
    (folder / "manifest.json").write_text(json.dumps(raw))
    with pytest.raises(RecordingError, match=r"manifest\.json: recordings\.0\.file"):
        read_manifest(folder)


@pytest.mark.parametrize("read", [read_calibration, read_score])
@pytest.mark.parametrize("text", ["", "{", "[]", "null", "{}", "[" * 10_000, '{"schema_version": 99}', "\0"])
def test_other_json_is_a_sentence(tmp_path, read, text):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(
        RecordingError, match=r"a\.json: .*(expected a file of `diagnosis|schema version is 99; .*reads up to)"
    ):
        read(tmp_path / "a.json")


def test_a_damaged_recording_of_a_blind_set_is_a_sentence(tmp_path):
    folder, _ = write_set(tmp_path / "set", [Case("none", truth="no_gap")])
    path = folder / "recordings" / "0000.nc"
    assert set(inputs_of(path)) == {"sun"}
    data = path.read_bytes()
    for content in (b"", data[:50], b"CDF\x02" + b"\xff" * 100, b"\x89HDF" + bytes(100)):
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=r"0000\.nc: cannot be read as NetCDF"):
            inputs_of(path)
