"""Readers of ``shared`` on damaged files, and on files made to do harm."""

import os
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from shared.children import command, environment
from shared.errors import DatasetError, RecordingError, SystemDescriptionError
from shared.netcdf import read_netcdf
from shared.reading import parse_json, parse_toml, read_json
from shared.store import read_manifest, write_manifest
from shared.system import load_system, parse_system
from tests.hostile import cases_shared
from tests.hostile.cases_shared import load
from tests.hostile.properties import property_of
from tests.trainer.conftest import make_dataset

test_damaged = property_of(cases_shared)


@pytest.fixture
def folder(tmp_path):
    return make_dataset(tmp_path / "ds", systems=10)


def record(path, count=8, **options):
    data = xr.Dataset({"a": ("time", np.arange(float(count)), {"units": "K"})}, {"time": np.arange(float(count))})
    data.to_netcdf(path, **options)
    return path


# ---------------------------------------------------------------- text


@pytest.mark.skipif(sys.platform == "win32", reason="no such files there")
def test_what_is_no_regular_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    for path, kind in ((tmp_path / "pipe.json", "a pipe"), (tmp_path, "a folder")):
        with pytest.raises(DatasetError, match=rf"cannot be read: it is .*{kind}"):
            read_json(path, DatasetError, "a file")
    (tmp_path / "device.json").symlink_to("/dev/zero")
    with pytest.raises(DatasetError, match=r"device\.json: cannot be read: it is a device"):
        read_json(tmp_path / "device.json", DatasetError, "a file")


def test_a_file_beyond_its_limit_is_refused_before_it_is_read(tmp_path):
    with open(tmp_path / "sparse.json", "wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(DatasetError, match=r"sparse\.json: has 1048576 MiB; expected a file, of at most 64 MiB"):
        read_json(tmp_path / "sparse.json", DatasetError, "a file")
    with pytest.raises(SystemDescriptionError, match="of at most 1 MiB"):
        load_system(tmp_path / "sparse.json")


@pytest.mark.parametrize("text", ["[" * 100_000, "[" * 150 + "]" * 150, "9" * 5000, "\0"])
def test_hostile_json_is_a_sentence(text):
    with pytest.raises(DatasetError, match=r"^here: not valid JSON: .*; expected x$"):
        parse_json(text, "here", DatasetError, "x")


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "a" + ".a" * 100_000 + " = 1",
        "[" + "'a' . " * 500 + "a]",
        "a = " + "9" * 5000,
        "a = 9223372036854775808",
        "\0",
    ],
)
def test_hostile_toml_is_a_sentence(text):
    with pytest.raises(SystemDescriptionError, match=r"^here: not valid TOML: "):
        parse_toml(text, "here", SystemDescriptionError)


@pytest.mark.parametrize("value", ["nan", "1e999"])
def test_numbers_of_a_description_are_finite(value):
    text = (cases_shared.ROOM / "system.toml").read_text(encoding="utf-8")
    line = next(one for one in text.splitlines() if one.startswith("tolerance = "))
    with pytest.raises(SystemDescriptionError, match=r"tolerance"):
        parse_system(text.replace(line, f"tolerance = {value}", 1), Path("mine.toml"))


# ---------------------------------------------------------------- datasets


def test_a_damaged_shard_never_meets_the_netcdf_library(folder, monkeypatch):
    shard = folder / "shards" / "000.nc"
    data = bytearray(shard.read_bytes())
    data[100] ^= 1
    shard.write_bytes(data)
    opened, Real = [], netCDF4.Dataset
    monkeypatch.setattr(netCDF4, "Dataset", lambda path, *rest: opened.append(path) or Real(path, *rest))
    with pytest.raises(DatasetError, match=r"000\.nc: damaged or changed, its sha256 is not the manifest's"):
        load(folder)
    assert opened == []


def test_a_shard_beside_the_folder_is_refused(folder):
    manifest = read_manifest(folder)
    for name in ("../secret.nc", "/etc/passwd", "a/b.nc", "a\0.nc", ""):
        manifest.shards[0].file = name
        write_manifest(folder, manifest)
        with pytest.raises(DatasetError):
            load(folder)


# ---------------------------------------------------------------- NetCDF, in a child process that is started for it

started = pytest.mark.usefixtures("started_readers")


@pytest.mark.parametrize("form", ["NETCDF4", "NETCDF3_CLASSIC"])
@started
def test_a_whole_file_is_read_as_xarray_reads_it(tmp_path, form):
    values = np.array([1.0, np.nan, 3.0])
    data = xr.Dataset({"a": ("time", values.astype("f4"), {"units": "K"}), "n": ("time", 0.5 * np.arange(3))})
    data = data.assign_coords(time=("time", 60.0 * np.arange(3), {"units": "seconds since 2001-01-01"}))
    data.attrs = {"title": "x", "numbers": np.array([1.0, 2.0])}
    data["n"].encoding = {"scale_factor": 0.5, "add_offset": 3.0, "_FillValue": -1, "dtype": "i2"}
    path = tmp_path / "a.nc"
    data.to_netcdf(path, format=form)
    for times in (False, True):
        ours = read_netcdf(path, RecordingError, "a recording", times=times)
        xr.testing.assert_identical(ours, xr.load_dataset(path, decode_times=times, decode_timedelta=False))


@started
def test_a_file_that_declares_more_than_it_can_hold_is_refused(tmp_path):
    with netCDF4.Dataset(tmp_path / "a.nc", "w") as file:
        file.createDimension("time", 1 << 40)
        file.createVariable("level", "f8", ("time",), chunksizes=(1 << 20,))
    with pytest.raises(RecordingError, match=r"a\.nc: cannot be read as NetCDF \(ValueError: it declares 8388608 MiB"):
        read_netcdf(tmp_path / "a.nc", RecordingError, "a recording")


def crash(tmp_path, monkeypatch, body):
    (tmp_path / "lethal.py").write_text(body)
    monkeypatch.setattr("shared.netcdf.command", lambda _, *rest: command("lethal", *rest))
    monkeypatch.setattr("shared.netcdf.environment", lambda: environment() | {"PYTHONPATH": str(tmp_path)})
    return record(tmp_path / "a.nc")


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)", "its reader crashed: SIGSEGV"),
        (
            "import resource\nresource.setrlimit(resource.RLIMIT_CPU, (1, 1))\nwhile True: pass",
            "reading it takes too long",
        ),
        ("print('{')", "Expecting"),
        ('print(\'{"variables": [{"name": "a", "dims": ["t"], "shape": [9], "dtype": "f8"}]}\')', "buffer"),
    ],
)
@started
def test_a_reader_that_goes_down_takes_nobody_along(tmp_path, monkeypatch, body, sentence):
    path = crash(tmp_path, monkeypatch, body)
    with pytest.raises(
        RecordingError, match=rf"a\.nc: cannot be read as NetCDF \(.*{sentence}.*; expected a recording"
    ):
        read_netcdf(path, RecordingError, "a recording")


def test_a_child_finds_its_modules_where_its_parent_does_and_not_in_the_current_folder(tmp_path):
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "__init__.py").write_text("")
    (tmp_path / "shared" / "netcdf_child.py").write_text("print('taken over')")
    path = record(tmp_path / "a.nc")
    words = command("shared.netcdf_child", str(path), "1000000", "10")
    said = subprocess.run(words, cwd=tmp_path, env=environment(), capture_output=True, check=True).stdout
    assert b"taken over" not in said
    assert b'"variables"' in said
    plain = subprocess.run([words[0], *words[2:]], cwd=tmp_path, capture_output=True, check=False).stdout
    assert b"taken over" in plain  # what would happen otherwise
