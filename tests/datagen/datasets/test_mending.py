"""A repair has the whole dataset in view: what had failed before, what fails now, and what others did meanwhile."""

import shutil

import pytest

from datagen import merge, run, verify
from datagen.datasets import mending
from shared.errors import SimulationError
from shared.store import read_manifest
from tests.datagen.faults import failing, killed_at_write, shards_in

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("in_this_process")]
SIZE = {"systems": 10, "seed": 3, "shard_size": 3, "hours": 1.0, "failure_budget": 1.0, "quiet": True}


@pytest.fixture
def damaged(tank, tmp_path, monkeypatch):
    """A dataset of which two systems in ten have failed, and two shards are gone; the shards' bytes before that."""
    failing(monkeypatch, 4, 8)
    run(tank, tmp_path / "ds", **SIZE)
    failing(monkeypatch)
    before = {path.name: path.read_bytes() for path in shards_in(tmp_path / "ds")}
    for path in shards_in(tmp_path / "ds")[1:3]:
        path.write_bytes(path.read_bytes()[:100])
    return tmp_path / "ds", before


def test_systems_that_had_failed_before_do_not_stop_it(damaged):
    folder, before = damaged
    assert mending.repair(folder) == ["shard-000001.nc", "shard-000002.nc"]
    assert {path.name: path.read_bytes() for path in shards_in(folder)} == before
    assert verify(folder) == []


def test_a_system_that_fails_now_is_told_with_its_cause(damaged, monkeypatch):
    folder, _ = damaged
    failing(monkeypatch, 7)
    with pytest.raises(SimulationError, match=r"shard-000002\.nc: system 7 could not .* system 7 does not want to; "):
        mending.repair(folder)
    assert len(read_manifest(folder).shards) == 4


@pytest.fixture
def merged(tank, tmp_path):
    """A merged dataset, whose order is not that of its file names, of which two shards are damaged; and what it was."""
    folder = tmp_path / "parts"
    for seed in (9, 10):
        run(tank, folder / f"{seed}", **{**SIZE, "systems": 5, "seed": seed})
    merge([folder / "9", folder / "10"], folder / "ds")
    before = read_manifest(folder / "ds")
    for entry in before.shards[:3:2]:
        path = folder / "ds" / "shards" / entry.file
        path.write_bytes(path.read_bytes()[:100])
    return folder / "ds", before


def test_the_shards_of_a_merged_dataset_keep_their_order_and_none_is_lost_by_a_killed_repair(merged, tank, tmp_path):
    """Systems of equal index follow that order, and with them what a training takes for the same dataset."""
    folder, before = merged
    order = [entry.file for entry in before.shards]
    assert order != sorted(order)
    calm = shutil.copytree(folder, tmp_path / "calm")
    writes = killed_at_write(1000, mending.repair, calm, tank)
    assert read_manifest(calm) == before
    assert verify(calm) == []
    assert writes >= 4
    for last in range(writes):
        copy = shutil.copytree(folder, tmp_path / f"killed-{last}")
        assert killed_at_write(last, mending.repair, copy, tank) == last
        assert [entry.file for entry in read_manifest(copy).shards] == order
        mending.repair(copy, tank)
        assert read_manifest(copy) == before
