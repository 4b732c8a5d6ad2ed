"""``--retry-failures``, killed before each of its writes: what was there is still there, what failed is still known."""

import json
import shutil

import pytest

from datagen import info, run, verify
from datagen.farming import worker
from shared.store import DatasetFolder, read_manifest
from tests.datagen.faults import failing, hashes, killed_at_write, shards_in

pytestmark = pytest.mark.usefixtures("in_this_process")
SIZE = {"systems": 6, "seed": 3, "shard_size": 3, "hours": 1.0, "failure_budget": 1.0, "quiet": True}
BAD = 4
"""The system that fails at first; it is in the second shard."""


@pytest.fixture
def dataset(tank, tmp_path, monkeypatch):
    """A dataset whose system BAD has failed."""
    failing(monkeypatch, BAD)
    run(tank, tmp_path / "ds", **SIZE)
    failing(monkeypatch)
    assert [one["system"] for one in failures(tmp_path / "ds")] == [BAD]
    return tmp_path / "ds"


def failures(folder):
    return [json.loads(line) for line in (folder / "failures.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("shared", [True, False], ids=["in place", "sent back"])
def test_killed_before_any_write_it_loses_nothing(tank, dataset, tmp_path, monkeypatch, shared):
    if not shared:
        monkeypatch.setattr(worker, "sees_folder", lambda *_: False)
    run(tank, tmp_path / "whole", **SIZE)
    whole, untouched = hashes(tmp_path / "whole"), (dataset / "shards" / "shard-000000.nc").stat().st_mtime_ns
    calm = shutil.copytree(dataset, tmp_path / "calm")
    writes = killed_at_write(1000, run, tank, calm, retry_failures=True, **SIZE)
    assert writes >= 6
    assert hashes(calm) == whole
    for last in range(shared, writes, 2):  # every other one in one way, those between them in the other
        folder = shutil.copytree(dataset, tmp_path / f"{last}")
        assert killed_at_write(last, run, tank, folder, retry_failures=True, **SIZE) == last
        run(tank, folder, **SIZE)  # a plain run goes on, and what it leaves is in order
        assert verify(folder) == []
        known = {*DatasetFolder(folder).load().systems.tolist(), *(one["system"] for one in failures(folder))}
        assert known == set(range(6))
        run(tank, folder, retry_failures=True, **SIZE)
        assert hashes(folder) == whole
        assert (folder / "failures.jsonl").read_text() == ""
        assert (folder / "shards" / "shard-000000.nc").stat().st_mtime_ns == untouched


@pytest.mark.parametrize(("again", "shared"), [({3, 5}, False), ({3, 4}, True)])
def test_a_system_that_was_there_is_not_lost_where_it_fails_this_time(tank, dataset, monkeypatch, again, shared):
    """The shard keeps its file and its entry, and what is told to have failed is what is not in it."""
    if not shared:
        monkeypatch.setattr(worker, "sees_folder", lambda *_: False)
    before = (read_manifest(dataset).shards, [path.read_bytes() for path in shards_in(dataset)])
    failing(monkeypatch, *again)
    run(tank, dataset, retry_failures=True, **SIZE)
    assert (read_manifest(dataset).shards, [path.read_bytes() for path in shards_in(dataset)]) == before
    assert [one["system"] for one in failures(dataset)] == [BAD]
    assert verify(dataset) == []
    assert len(list((dataset / "shards").iterdir())) == 2  # nothing of the second attempt


def test_what_fewer_systems_fail_in_is_better(tank, tmp_path, monkeypatch):
    folder = tmp_path / "ds"
    failing(monkeypatch, 3, 4)
    run(tank, folder, **SIZE)
    failing(monkeypatch, 4)
    run(tank, folder, retry_failures=True, **SIZE)
    assert [one["system"] for one in failures(folder)] == [4]
    told = info(folder)
    assert (told.systems_done, told.systems_failed, told.complete) == (5, 1, False)
    assert DatasetFolder(folder).load().systems.tolist() == [0, 1, 2, 3, 5]
    assert verify(folder) == []
