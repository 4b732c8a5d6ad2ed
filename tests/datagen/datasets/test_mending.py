"""A repair has the whole dataset in view: what had failed before, what fails now, and what others did meanwhile."""

import os
import shutil
from contextlib import suppress

import pytest

from datagen import merge, run, verify
from datagen.datasets import mending
from shared.errors import SimulationError
from shared.store import read_manifest
from tests.datagen.faults import failing, faulty_system, shards_in, stay_in_this_process

pytestmark = pytest.mark.slow
SIZE = {"systems": 10, "seed": 3, "shard_size": 3, "hours": 1.0, "failure_budget": 1.0, "quiet": True}


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    stay_in_this_process(monkeypatch)


@pytest.fixture(scope="module")
def system(tmp_path_factory):
    return faulty_system(tmp_path_factory.mktemp("faulty"))


@pytest.fixture
def damaged(system, tmp_path, monkeypatch):
    """A dataset of which two systems in ten have failed, and two shards are gone; the shards' bytes before that."""
    failing(monkeypatch, 4, 8)
    run(system, tmp_path / "ds", **SIZE)
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


class Killed(BaseException):
    """In place of ``kill -9``."""


def of_two_seeds(system, folder):
    """A merged dataset, whose order is not that of its file names, of which two shards are damaged; and what it was."""
    for seed in (9, 10):
        run(system, folder / f"{seed}", **{**SIZE, "systems": 5, "seed": seed})
    merge([folder / "9", folder / "10"], folder / "ds")
    before = read_manifest(folder / "ds")
    for entry in before.shards[:3:2]:
        path = folder / "ds" / "shards" / entry.file
        path.write_bytes(path.read_bytes()[:100])
    return folder / "ds", before


def test_the_shards_of_a_merged_dataset_keep_their_order(system, tmp_path):
    """Systems of equal index follow it, and with them what a training takes for the same dataset."""
    folder, before = of_two_seeds(system, tmp_path)
    assert [entry.file for entry in before.shards] != sorted(entry.file for entry in before.shards)
    mending.repair(folder, system)
    assert read_manifest(folder) == before
    assert verify(folder) == []


def test_a_repair_of_a_merged_dataset_that_is_killed_loses_no_shard(system, tmp_path, monkeypatch):
    folder, before = of_two_seeds(system, tmp_path)
    real, writes = os.replace, 1000
    for last in range(1000):
        copy, count = shutil.copytree(folder, tmp_path / f"killed-{last}"), 0

        def replace(*names, last=last):
            nonlocal count
            if count >= last:
                raise Killed
            count += 1
            real(*names)

        with monkeypatch.context() as patch, suppress(Killed):
            patch.setattr(os, "replace", replace)
            mending.repair(copy, system)
            writes = last
        assert [entry.file for entry in read_manifest(copy).shards] == [entry.file for entry in before.shards]
        if writes == last:
            break
        mending.repair(copy, system)
        assert read_manifest(copy) == before
        assert verify(copy) == []
    assert writes >= 4
