"""Readers of ``shared`` on damaged files, and on files made to do harm."""

import json
import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

from shared.children import command, environment
from shared.errors import DatasetError, RecordingError, SystemDescriptionError
from shared.netcdf import read_netcdf
from shared.reading import parse_json, parse_toml, read_bytes, read_json, read_text, shown
from shared.store import DatasetFolder, read_manifest, write_manifest
from shared.system import load_system, parse_system, system_from_canonical
from tests.hostile import cases_shared
from tests.hostile.cases_shared import load, seal_shards
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


def test_no_more_room_is_made_than_a_file_takes(tmp_path):
    (tmp_path / "small").write_bytes(b"x" * 100)
    tracemalloc.start()
    assert read_bytes(tmp_path / "small", DatasetError, "a file") == b"x" * 100
    assert tracemalloc.get_traced_memory()[1] < 1 << 20
    tracemalloc.stop()


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32", "latin-1", "nowhere", "rot13"])
def test_another_encoding_is_a_sentence(tmp_path, encoding):
    (tmp_path / "a.json").write_bytes('{"a": "é"}'.encode("latin-1" if encoding in ("nowhere", "rot13") else encoding))
    with pytest.raises(DatasetError, match=r"a\.json: (cannot be read as text|not valid JSON)"):
        read_json(tmp_path / "a.json", DatasetError, "a file")
    if encoding in ("nowhere", "rot13"):
        with pytest.raises(DatasetError, match="cannot be read as text"):
            read_text(tmp_path / "a.json", DatasetError, "a file", encoding=encoding)


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"a":' * 100_000, "[" * 150 + "]" * 150, "9" * 5000, "", "\0", '{"a": 1', "{'a': 1}"]
)
def test_hostile_json_is_a_sentence(text):
    with pytest.raises(DatasetError, match=r"^here: not valid JSON: .*; expected x$"):
        parse_json(text, "here", DatasetError, "x")


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "a = " + "{a=" * 100_000,
        "a" + ".a" * 100_000 + " = 1",
        "[" + "'a' . " * 500 + "a]",
        "a = " + "9" * 5000,
        "a = [0x" + "f" * 5000 + "]",
        "a = 9223372036854775808",
        "a = 1979-13-45",
        "a = 1\na = 2",
        "\0",
    ],
)
def test_hostile_toml_is_a_sentence(text):
    with pytest.raises(SystemDescriptionError, match=r"^here: not valid TOML: "):
        parse_toml(text, "here", SystemDescriptionError)


def test_a_number_that_cannot_be_written_can_be_said():
    assert shown(int("f" * 5000, 16)) == "a number of 20000 bits"
    assert len(shown("x" * 10**6)) < 300
    deep = []
    for _ in range(5000):
        deep = [deep]
    assert len(shown(deep)) < 300


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999"])
def test_numbers_of_a_description_are_finite(value):
    text = (cases_shared.ROOM / "system.toml").read_text(encoding="utf-8")
    line = next(one for one in text.splitlines() if one.startswith("tolerance = "))
    with pytest.raises(SystemDescriptionError, match=r"tolerance"):
        parse_system(text.replace(line, f"tolerance = {value}", 1), Path("mine.toml"))


# ---------------------------------------------------------------- datasets


def test_a_system_that_is_no_table_is_a_sentence(tmp_path):
    for text in ("[]", "1", "null", "{", '{"parameters": 3}', '{"parameters": [3]}'):
        with pytest.raises(SystemDescriptionError):
            system_from_canonical(text, tmp_path)


@pytest.mark.parametrize("version", ["²", "9" * 5000, None, [], {"a": 1}, "2.x", -1, 3.5])
def test_odd_versions_are_a_sentence_or_read(folder, version):
    path = folder / "manifest.json"
    raw = json.loads(path.read_text())
    raw["schema_version"] = version
    path.write_text(json.dumps(raw))
    try:
        read_manifest(folder)
    except DatasetError as error:
        assert "manifest.json" in str(error)


@pytest.mark.parametrize("index", [-1, 2**63, 10**30, 1.5, "x", None])
def test_an_index_that_no_system_has_is_a_sentence(folder, index):
    path = folder / "manifest.json"
    raw = json.loads(path.read_text())
    raw["shards"][0]["systems"][0] = index
    path.write_text(json.dumps(raw))
    with pytest.raises(DatasetError, match=r"manifest\.json: shards\.0\.systems\.0"):
        read_manifest(folder)


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


def declare_much(folder):
    """A shard whose hash is right, and which declares a terabyte in some kilobytes."""
    path = folder / "shards" / "000.nc"
    with netCDF4.Dataset(path, "a") as shard:
        shard.createDimension("much", 1 << 37)
        shard.createVariable("level_of_all", "f8", ("much",), chunksizes=(1 << 20,))
    seal_shards(folder)


def test_a_shard_that_declares_a_terabyte_is_refused(folder):
    declare_much(folder)
    with pytest.raises(DatasetError, match=r"000\.nc: .*it declares 1048\d+ MiB, more than the \d+ it may hold"):
        load(folder)
    opened = DatasetFolder(folder)
    with pytest.raises(DatasetError, match=r"000\.nc: .*it declares 1048\d+ MiB"):
        opened.shard_facts(opened.manifest.shards[0])


@pytest.mark.parametrize(
    ("name", "values"),
    [("level", np.full((5, 480), np.nan)), ("tank.drain", np.full(5, -1.0)), ("time", np.full(480, np.inf))],
)
def test_values_that_nobody_can_train_on_are_a_sentence(folder, name, values):
    with netCDF4.Dataset(folder / "shards" / "000.nc", "a") as shard:
        shard[name][...] = values
    seal_shards(folder)
    with pytest.raises(DatasetError, match=f"{name}.*finite|a parameter of system"):
        load(folder)


def test_a_shard_of_text_in_place_of_numbers_is_a_sentence(folder, tmp_path):
    path = folder / "shards" / "000.nc"
    with netCDF4.Dataset(path) as shard:
        facts = {name: shard.getncattr(name) for name in shard.ncattrs()}
    path.unlink()
    data = xr.Dataset({"level": ("system", np.array(["a", "b"], dtype=object))}, {"system": [0, 1]}, facts)
    data.to_netcdf(path)
    seal_shards(folder)
    with pytest.raises(DatasetError, match=r"000\.nc: not as the manifest says"):
        load(folder)


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


@started
def test_attributes_that_make_no_sense_are_a_sentence(tmp_path):
    with netCDF4.Dataset(tmp_path / "a.nc", "w") as file:
        file.createDimension("time", 3)
        time = file.createVariable("time", "f8", ("time",))
        time.units = "seconds since when it began"
        time[:] = 1.0
        time.scale_factor = "much"
    with pytest.raises(RecordingError, match=r"a\.nc: cannot be read as NetCDF"):
        read_netcdf(tmp_path / "a.nc", RecordingError, "a recording", times=True)


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
