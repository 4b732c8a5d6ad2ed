"""What may happen to a farm, done to it: killed, interrupted, out of disk, FMUs that crash, hang and leak."""

import asyncio
import json
import os
import shlex
import shutil
import signal
import subprocess
from collections import Counter

import dask
import numpy as np
import psutil
import pytest
from distributed.scheduler import Scheduler

from datagen import run, verify
from datagen.datasets import mending
from datagen.farming.collection import Collection
from shared.console import STOPPED
from shared.errors import DatasetError, SimulationError
from shared.lock import FolderLock
from shared.store import DatasetFolder, read_manifest, write_manifest
from tests.datagen.faults import (
    alive,
    failing,
    family_of,
    farm,
    faulty,
    finish,
    hashes,
    kill,
    run_here,
    shards_in,
    wait_for,
    workers_of,
)

pytestmark = pytest.mark.slow
SIZE = {"systems": 12, "seed": 3, "shard_size": 2, "workers": 1}
MANY = 24
"""Shards of the runs that are disturbed: enough that the disturbance comes while there is work left."""
WORDS = ["--systems", MANY, "--seed", 3, "--shard-size", 1, "--workers", 1, "--hours", 8760]


@pytest.fixture(scope="module")
def whole(tank, tmp_path_factory):
    """Many short shards, undisturbed: what every disturbed run must come to."""
    folder = tmp_path_factory.mktemp("whole") / "ds"
    run_here(tank, folder, **{**SIZE, "systems": MANY, "shard_size": 1, "hours": 8760.0})
    return folder


@pytest.fixture(scope="module")
def dozen(tank, tmp_path_factory):
    """A small dataset, undisturbed; tests take copies of it."""
    folder = tmp_path_factory.mktemp("dozen") / "ds"
    run_here(tank, folder, **SIZE)
    return folder


@pytest.fixture
def made(dozen, tmp_path):
    """A copy of the small dataset, to do something to."""
    return shutil.copytree(dozen, tmp_path / "ds")


def test_stopped_again_and_again_it_is_the_same_and_leaves_nothing_behind(tank, whole, tmp_path):
    """In one way after the other: each run goes on from what the one before it, killed, has left."""
    out = tmp_path / "ds"
    interrupted_early(tank, out)
    killed_with_work_left(tank, out)
    assert hashes(out).items() <= hashes(whole).items()
    run_here(tank, out, **{**SIZE, "systems": MANY, "shard_size": 1, "hours": 8760.0})
    assert hashes(out) == hashes(whole)
    assert verify(out) == []
    assert (out / "failures.jsonl").read_text() == ""
    for folder in (".", "shards"):
        assert sorted(path.name for path in (out / folder).iterdir()) == sorted(
            path.name for path in (whole / folder).iterdir()
        )


def interrupted_early(system, out):
    """Interrupt all processes of a run, as a terminal does, when there is no shard yet."""
    process = farm(system, "--out", out, *WORDS)
    wait_for(lambda: workers_of(process.pid) or process.poll() is not None)
    family = family_of(process.pid)
    assert process.poll() is None
    assert shards_in(out) == []
    os.killpg(process.pid, signal.SIGINT)
    code, said = finish(process)
    assert code == STOPPED, said
    again = shlex.join(["datagen", "run", *map(str, [system, "--out", out, *WORDS])])
    assert f"finished work is kept, and this command continues it:\n  {again}\n" in said, said
    assert "Traceback" not in said, said
    wait_for(lambda: not alive(family))


def killed_with_work_left(system, out):
    """Kill a run that has written some shards; its workers follow it."""
    process = farm(system, "--out", out, *WORDS)
    wait_for(lambda: len(shards_in(out)) >= 3 or process.poll() is not None)
    family = family_of(process.pid)
    assert process.poll() is None
    kill(process.pid)
    finish(process)
    wait_for(lambda: not alive(family))
    assert 3 <= len(shards_in(out)) < MANY


def test_a_second_run_on_one_folder_is_refused(tank, made):
    before = hashes(made)
    with FolderLock(made), pytest.raises(DatasetError, match=rf"another run is at it \(process {os.getpid()}"):
        run(tank, made, **SIZE)
    run_here(tank, made, **SIZE)
    assert hashes(made) == before


def test_the_failure_budget_stops_a_run_that_goes_wrong(tank, tmp_path, monkeypatch):
    failing(monkeypatch, 0)
    with pytest.raises(SimulationError, match=r"1 system failed, more than the failure budget of 0% of 2.*not want to"):
        run_here(tank, tmp_path / "ds", failure_budget=0.0, **{**SIZE, "systems": 2, "shard_size": 1})


def test_only_the_guilty_systems_are_quarantined(tank, dozen, tmp_path, monkeypatch, taken_to_be_alive):
    """One system crashes and one hangs, each beside one that does neither; a second run leaves all as it is."""
    bad = faulty.describe(tank.parent, fault=6, above=7.67e-5)
    out, scratch, size = tmp_path / "ds", tmp_path / "scratch", {**SIZE, "systems": 4, "failure_budget": 0.5}
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))  # of the workers
    manifest = run(bad, out, timeout=4.0, quiet=True, **size)
    assert {*manifest.done()} == {(3, 1), (3, 2)}
    failures = [json.loads(line) for line in (out / "failures.jsonl").read_text().splitlines()]
    innocent = DatasetFolder(dozen).load()
    for one, index, cause in zip(failures, (0, 3), ("SIGSEGV", "did not end within 4 s"), strict=True):
        assert (one["system"], one["root_seed"]) == (index, 3)
        assert one["parameters"] == {"k": innocent.parameters[index, 0]}
        assert cause in one["cause"]
    assert (DatasetFolder(out).load().values == innocent.values[[1, 2]]).all()
    assert verify(out) == []
    assert list(scratch.rglob("modelDescription.xml")) == []
    before = times_of(out)
    assert run(bad, out, quiet=True, **size).shards == manifest.shards
    assert times_of(out) == before


def listening():
    """Addresses at which this process and all that it started wait for connections."""
    here = psutil.Process()
    opened = [one for process in (here, *here.children(recursive=True)) for one in process.net_connections(kind="tcp")]
    return {tuple(one.laddr) for one in opened if one.status == psutil.CONN_LISTEN}


def test_a_leaking_fmu_gets_fresh_workers_and_nothing_listens_beyond_this_machine(
    tank, tmp_path, monkeypatch, taken_to_be_alive
):
    """Four years of a tank, each of which loses sixty megabytes: no worker sees many of them, however short.

    Dask would give up for good a worker that is not back in time: the farm does not let it, whatever is set. Nor is its
    nanny closed where the scheduler has let it go and says so late, as on a busy machine; heartbeats come meanwhile.
    """
    remove, take, seen, opened, before = Scheduler.remove_worker, Collection.take, [], set(), listening()

    async def late(self, address, **words):
        removed = await remove(self, address, **words)
        await asyncio.sleep(1.2 if words.get("expected") else 0.0)
        return removed

    def watched(self, piece, result):
        seen.append(result.pid)
        opened.update(listening() - before)
        take(self, piece, result)

    monkeypatch.setattr(Scheduler, "remove_worker", late)
    monkeypatch.setattr(Collection, "take", watched)
    size = {**SIZE, "systems": 4, "shard_size": 1, "hours": 8760.0, "quiet": True}
    with dask.config.set({"distributed.deploy.lost-worker-timeout": "1s"}):
        manifest = run(faulty.describe(tank.parent, leak=60e6), tmp_path / "leaky", recycle=100e6, **size)
    assert len(manifest.done()) == len(seen) == 4
    assert (tmp_path / "leaky" / "failures.jsonl").read_text() == ""
    assert len({*seen}) >= 2
    assert max(Counter(seen).values()) <= 3  # two or three make it grow by a hundred; the system may give some back
    assert len(opened) >= 3  # scheduler, worker, dashboard
    assert {ip for ip, _ in opened} <= {"127.0.0.1", "::1"}


def times_of(folder):
    return {path.name: path.stat().st_mtime_ns for path in shards_in(folder)}


def test_more_systems_by_extension_leave_the_old_shards_alone(tank, dozen, tmp_path):
    out = tmp_path / "grown"
    run_here(tank, out, **{**SIZE, "systems": 5})
    before = times_of(out)
    with pytest.raises(DatasetError, match="--extend"):
        run_here(tank, out, **{**SIZE, "systems": 8})
    run_here(tank, out, extend=True, **{**SIZE, "systems": 8})
    run_here(tank, out, **{**SIZE, "systems": 8})
    assert before.items() <= times_of(out).items()
    grown, once = DatasetFolder(out).load(), DatasetFolder(dozen).load()
    assert grown.systems.tolist() == list(range(8))
    assert (grown.values == once.values[:8]).all()
    assert (grown.splits == once.splits[:8]).all()
    with pytest.raises(DatasetError, match="systems is 8, this run has 5"):
        run_here(tank, out, extend=True, **{**SIZE, "systems": 5})


def test_a_shard_that_was_written_but_not_recorded_is_adopted(tank, made):
    manifest = read_manifest(made)
    write_manifest(made, manifest.model_copy(update={"shards": manifest.shards[:2]}))
    spoilt = made / "shards" / manifest.shards[-1].file
    spoilt.write_bytes(spoilt.read_bytes()[:5000])
    before = times_of(made)
    run_here(tank, made, **SIZE)
    assert [name for name, time in times_of(made).items() if time != before[name]] == [spoilt.name]
    assert read_manifest(made).shards == manifest.shards


def test_repair_mends_the_damaged_shards_and_no_other(made, in_this_process):
    whole, times = {path.name: path.read_bytes() for path in shards_in(made)}, times_of(made)
    flipped, cut, removed = victims = [made / "shards" / f"shard-{number:06d}.nc" for number in (1, 2, 4)]
    data = bytearray(flipped.read_bytes())
    data[len(data) // 2] ^= 0x10
    flipped.write_bytes(data)
    data = cut.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    removed.unlink()
    names = [path.name for path in victims]
    assert [[name in fault for name in names] for fault in verify(made)] == np.eye(3, dtype=bool).tolist()
    assert mending.repair(made) == names
    assert {path.name: path.read_bytes() for path in shards_in(made)} == whole
    assert {name for name, time in times_of(made).items() if time == times[name]} == {*whole} - {*names}
    assert verify(made) == []


@pytest.fixture
def small_disk(tmp_path):
    """A file system of its own, a megabyte large."""
    where = tmp_path / "disk"
    where.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", where], capture_output=True)
    if made.returncode:
        pytest.skip("a file system can only be mounted by root")
    yield where
    subprocess.run(["umount", "-l", where], check=True)


def test_a_full_disk_is_a_sentence_and_loses_nothing(tank, whole, small_disk):
    size = {**SIZE, "hours": 8760.0, "systems": MANY, "shard_size": 1}
    with pytest.raises(DatasetError, match=r"No space left.*same command goes on"):
        run_here(tank, small_disk / "ds", **size)
    subprocess.run(["mount", "-o", "remount,size=64m", small_disk], check=True)
    assert all("not in the manifest" in one or "README.md: missing" in one for one in verify(small_disk / "ds"))
    run_here(tank, small_disk / "ds", **size)
    assert hashes(small_disk / "ds") == hashes(whole)


def test_a_read_only_folder_is_a_sentence(tank, small_disk):
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    with pytest.raises(DatasetError, match=r"nothing can be written there \(Read-only file system\)"):
        run_here(tank, small_disk / "ds", **SIZE)
