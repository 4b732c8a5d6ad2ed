"""The schema and the store: what is written is read back, and what is broken is named."""

import errno
import json

import netCDF4
import numpy as np
import pytest
import xarray as xr

from shared.errors import DatasetError
from shared.schema import dataset_hash, split_of
from shared.store import (
    DatasetFolder,
    read_manifest,
    sha256_of,
    write_atomically,
    write_manifest,
)
from tests.shared.datasets import make_shard, write_dataset


def test_a_file_in_the_place_of_a_dataset_is_named(tmp_path):
    (tmp_path / "room.nc").write_text("a recording")
    with pytest.raises(DatasetError, match=r"room\.nc: is a file; expected the folder of a dataset made by"):
        DatasetFolder(tmp_path / "room.nc")


@pytest.fixture
def folder(tmp_path):
    return write_dataset(tmp_path / "ds", [[10, 11, 12], [0, 1, 2, 3]], systems=7, shard_size=4)


def test_what_is_written_is_read(folder):
    records = DatasetFolder(folder).load(["CO2", "TDryBul"])
    assert records.systems.tolist() == [0, 1, 2, 3, 10, 11, 12]
    assert records.values.shape == (7, 2, 48)
    assert records.values.dtype == np.float32
    shard = make_shard([10, 11, 12])
    np.testing.assert_array_equal(records.values[4:, 0], shard["CO2"].values)
    np.testing.assert_array_equal(records.parameters[4:, 1], shard["roo.AFlo"].values)
    np.testing.assert_array_equal(records.time, 3600.0 * np.arange(1, 49))
    assert records.splits.tolist() == [split_of(3, i) for i in records.systems]


def test_plain_xarray_reads_time_and_units(folder):
    data = xr.load_dataset(folder / "shards" / "shard-000000.nc")
    assert str(data["time"].values[0]).startswith("2001-01-01T01:00")
    assert data["TRoo"].attrs["units"] == "K"
    assert data["QHea"].attrs["cell_methods"] == "time: mean"
    assert data.attrs["Conventions"] == "CF-1.11"


def test_split_is_exact_in_every_ten_and_does_not_depend_on_how_many():
    splits = [split_of(5, i) for i in range(200)]
    for block in range(20):
        ten = splits[10 * block : 10 * block + 10]
        assert (ten.count(0), ten.count(1), ten.count(2)) == (8, 1, 1)
    assert [split_of(6, i) for i in range(200)] != splits


def test_content_hash_sees_every_value_and_not_the_layout(tmp_path):
    one = make_shard([0, 1])
    assert dataset_hash(one) == dataset_hash(make_shard([0, 1]))
    one.to_netcdf(tmp_path / "plain.nc")
    assert dataset_hash(xr.load_dataset(tmp_path / "plain.nc", decode_times=False)) == dataset_hash(one)
    changed = one.copy(deep=True)
    changed["CO2"].values[1, 5] = np.nextafter(changed["CO2"].values[1, 5], np.float32(9))
    assert dataset_hash(changed) != dataset_hash(one)


def change_manifest(folder, change):
    path = folder / "manifest.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))


def test_newer_schema_is_refused(folder):
    change_manifest(folder, lambda raw: raw | {"schema_version": "3.0"})
    with pytest.raises(DatasetError, match=r"schema version is '3\.0'.*update"):
        read_manifest(folder)


def test_newer_minor_version_is_read(folder):
    """The dataset as a version would have written it that knows more."""

    def newer(raw):
        major, _, minor = raw["schema_version"].partition(".")
        return raw | {"schema_version": f"{major}.{int(minor) + 5}", "licences": ["free"]}

    change_manifest(folder, newer)
    assert DatasetFolder(folder).load().values.shape[0] == 7


def test_broken_shards_are_named(folder):
    shard = folder / "shards" / "shard-000001.nc"
    whole = shard.read_bytes()
    shard.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DatasetError, match=r"shard-000001\.nc"):
        DatasetFolder(folder).load()
    shard.unlink()
    with pytest.raises(DatasetError, match=r"shard-000001\.nc.*missing"):
        DatasetFolder(folder).load()


def test_shard_of_another_system_is_refused(folder):
    with netCDF4.Dataset(folder / "shards" / "shard-000000.nc", "a") as shard:
        shard.system_hash = "f" * 64
    manifest = read_manifest(folder)
    manifest.shards[0].sha256 = sha256_of(folder / "shards" / "shard-000000.nc")
    write_manifest(folder, manifest)
    with pytest.raises(DatasetError, match="another system"):
        DatasetFolder(folder).load()


@pytest.mark.parametrize("text", ["", "{", "[]", '{"schema_version": "1.0"}'])
def test_broken_manifest_is_a_sentence(tmp_path, text):
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(DatasetError, match=r"manifest\.json"):
        read_manifest(tmp_path)


def test_unknown_channel_is_a_sentence(folder):
    with pytest.raises(DatasetError, match="no channel 'H2O'"):
        DatasetFolder(folder).load(["H2O"])


def test_a_shard_with_other_systems_than_the_manifest_lists_is_named(folder):
    change_manifest(folder, lambda raw: raw["shards"][1].update(systems=[0, 1, 2, 4]) or raw)
    with pytest.raises(DatasetError, match=r"shard-000001\.nc: not as the manifest says \(its systems are not those"):
        DatasetFolder(folder).load()


def test_a_disk_that_is_full_names_the_file_and_keeps_what_was_there(tmp_path, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "evaluation.json"
    write_atomically(path, b"old")
    monkeypatch.setattr("shared.store.os.fsync", full)
    with pytest.raises(OSError, match="No space left") as raised:
        write_atomically(path, b"new")
    assert raised.value.filename == str(path)
    assert path.read_bytes() == b"old" and [one.name for one in tmp_path.iterdir()] == ["evaluation.json"]
