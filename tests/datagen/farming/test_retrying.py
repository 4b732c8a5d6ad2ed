"""``--retry-failures``, killed before each of its writes: what was there is still there, what failed is still known."""

import json
import os
import shutil
from contextlib import suppress

import pytest

from datagen import info, run, verify
from datagen.farming import worker
from shared.store import DatasetFolder, read_manifest
from tests.datagen.faults import failing, faulty_system, hashes, shards_in, stay_in_this_process

SIZE = {"systems": 6, "seed": 3, "shard_size": 3, "hours": 1.0, "failure_budget": 1.0, "quiet": True}
BAD = 4
"""The system that fails at first; it is in the second shard."""


class Killed(BaseException):
    """In place of ``kill -9``."""


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch):
    stay_in_this_process(monkeypatch)


@pytest.fixture(scope="module")
def system(tmp_path_factory):
    return faulty_system(tmp_path_factory.mktemp("faulty"))


@pytest.fixture
def dataset(system, tmp_path, monkeypatch):
    """A dataset whose system BAD has failed."""
    failing(monkeypatch, BAD)
    run(system, tmp_path / "ds", **SIZE)
    failing(monkeypatch)
    assert [one["system"] for one in failures(tmp_path / "ds")] == [BAD]
    return tmp_path / "ds"


def failures(folder):
    return [json.loads(line) for line in (folder / "failures.jsonl").read_text().splitlines()]


def retry_killed(monkeypatch, system, folder, last):
    """Retry what failed, killed before the write after the ``last`` one; returns how many writes there were."""
    real, count = os.replace, 0

    def replace(*names):
        nonlocal count
        if count >= last:
            raise Killed
        count += 1
        real(*names)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", replace)
        with suppress(Killed):
            run(system, folder, retry_failures=True, **SIZE)
    return count


@pytest.mark.parametrize("shared", [True, False], ids=["in place", "sent back"])
def test_killed_before_any_write_it_loses_nothing(system, dataset, tmp_path, monkeypatch, shared):
    if not shared:
        monkeypatch.setattr(worker, "sees_folder", lambda *_: False)
    run(system, tmp_path / "whole", **SIZE)
    whole, untouched = hashes(tmp_path / "whole"), (dataset / "shards" / "shard-000000.nc").stat().st_mtime_ns
    writes = retry_killed(monkeypatch, system, shutil.copytree(dataset, tmp_path / "calm"), 1000)
    assert writes >= 6
    assert hashes(tmp_path / "calm") == whole
    for last in range(shared, writes, 2):  # every other one in one way, those between them in the other
        folder = shutil.copytree(dataset, tmp_path / f"{last}")
        assert retry_killed(monkeypatch, system, folder, last) == last
        run(system, folder, **SIZE)  # a plain run goes on, and what it leaves is in order
        assert verify(folder) == []
        known = {*DatasetFolder(folder).load().systems.tolist(), *(one["system"] for one in failures(folder))}
        assert known == set(range(6))
        run(system, folder, retry_failures=True, **SIZE)
        assert hashes(folder) == whole
        assert (folder / "failures.jsonl").read_text() == ""
        assert (folder / "shards" / "shard-000000.nc").stat().st_mtime_ns == untouched


@pytest.mark.parametrize(("again", "shared"), [({3, 5}, False), ({3, 4}, True)])
def test_a_system_that_was_there_is_not_lost_where_it_fails_this_time(system, dataset, monkeypatch, again, shared):
    """The shard keeps its file and its entry, and what is told to have failed is what is not in it."""
    if not shared:
        monkeypatch.setattr(worker, "sees_folder", lambda *_: False)
    before = (read_manifest(dataset).shards, [path.read_bytes() for path in shards_in(dataset)])
    failing(monkeypatch, *again)
    run(system, dataset, retry_failures=True, **SIZE)
    assert (read_manifest(dataset).shards, [path.read_bytes() for path in shards_in(dataset)]) == before
    assert [one["system"] for one in failures(dataset)] == [BAD]
    assert verify(dataset) == []
    assert len(list((dataset / "shards").iterdir())) == 2  # nothing of the second attempt


def test_what_fewer_systems_fail_in_is_better(system, tmp_path, monkeypatch):
    folder = tmp_path / "ds"
    failing(monkeypatch, 3, 4)
    run(system, folder, **SIZE)
    failing(monkeypatch, 4)
    run(system, folder, retry_failures=True, **SIZE)
    assert [one["system"] for one in failures(folder)] == [4]
    told = info(folder)
    assert (told.systems_done, told.systems_failed, told.complete) == (5, 1, False)
    assert DatasetFolder(folder).load().systems.tolist() == [0, 1, 2, 3, 5]
    assert verify(folder) == []
