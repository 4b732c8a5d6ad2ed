"""What may happen to a farm, done to it: killed, interrupted, out of disk, FMUs that crash, hang and leak."""

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys

import pytest

from datagen import mending, run, verify
from datagen.lock import FolderLock
from shared.console import ENDED, STOPPED
from shared.errors import DatasetError, SimulationError
from shared.store import DatasetFolder, read_manifest, write_manifest
from tests.datagen.faults import alive, family_of, farm, faulty, finish, hashes, kill, shards_in, wait_for, workers_of

pytestmark = pytest.mark.slow
SIZE = {"systems": 12, "seed": 3, "shard_size": 2, "workers": 2, "quiet": True}
MANY = 160
"""Shards of the runs that are disturbed: enough that the disturbance comes while there is work left."""
WORDS = ["--systems", MANY, "--seed", 3, "--shard-size", 1, "--workers", 2, "--hours", 8760]


@pytest.fixture(scope="module")
def tanks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("faulty")
    faulty.build(folder)
    return folder


@pytest.fixture(scope="module")
def good(tanks):
    return faulty.describe(tanks)


@pytest.fixture(scope="module")
def whole(good, tmp_path_factory):
    """Many short shards, undisturbed: what every disturbed run must come to."""
    folder = tmp_path_factory.mktemp("whole") / "ds"
    code, said = finish(farm(good, "--out", folder, *WORDS))
    assert code == 0, said
    return folder


@pytest.fixture(scope="module")
def dozen(good, tmp_path_factory):
    """A small dataset, undisturbed; tests take copies of it."""
    folder = tmp_path_factory.mktemp("dozen") / "ds"
    run(good, folder, **SIZE)
    return folder


@pytest.fixture
def made(dozen, tmp_path):
    """A copy of the small dataset, to do something to."""
    return shutil.copytree(dozen, tmp_path / "ds")


@pytest.mark.parametrize("victim", ["client", "worker", "interrupt", "terminate"])
def test_killed_and_run_again_it_is_the_same(good, whole, tmp_path, victim):
    process = farm(good, "--out", tmp_path / "ds", *WORDS)
    wait_for(lambda: len(shards_in(tmp_path / "ds")) >= 3 or process.poll() is not None)
    family = family_of(process.pid)
    if victim == "client":
        kill(process.pid)
        finish(process)
    elif victim in ("interrupt", "terminate"):  # a terminal interrupts all processes, a queue ends the one it knows
        os.killpg(process.pid, signal.SIGINT) if victim == "interrupt" else os.kill(process.pid, signal.SIGTERM)
        code, said = finish(process)
        assert code == {"interrupt": STOPPED, "terminate": ENDED}[victim], said
        again = shlex.join(["datagen", "run", *map(str, [good, "--out", tmp_path / "ds", *WORDS])])
        assert f"what was finished is kept, and this goes on from there:\n  {again}\n" in said, said
        assert "Traceback" not in said, said
    else:
        kill(workers_of(process.pid)[0])
    if victim == "worker":
        code, said = finish(process)
    else:
        assert len(hashes(tmp_path / "ds")) < MANY
        wait_for(lambda: not alive(family))
        code, said = finish(farm(good, "--out", tmp_path / "ds", *WORDS))
    assert code == 0, said
    assert hashes(tmp_path / "ds") == hashes(whole)
    assert verify(tmp_path / "ds") == []
    assert (tmp_path / "ds" / "failures.jsonl").read_text() == ""


FEW = ["--systems", 4, *WORDS[2:]]
MOMENTS = {
    "folder": lambda out, pid: (out / "manifest.json").exists() or len(family_of(pid)) > 1,
    "manifest": lambda out, pid: (out / "manifest.json").exists(),
    "workers": lambda out, pid: workers_of(pid),
    "all workers": lambda out, pid: len(workers_of(pid)) == 2,
}


@pytest.fixture(scope="module")
def few(good, tmp_path_factory):
    folder = tmp_path_factory.mktemp("few") / "ds"
    code, said = finish(farm(good, "--out", folder, *FEW))
    assert code == 0, said
    return folder


@pytest.mark.parametrize(
    ("moment", "how"),
    [
        ("folder", signal.SIGINT),
        ("manifest", signal.SIGKILL),
        ("workers", signal.SIGINT),
        ("workers", signal.SIGKILL),
        ("all workers", signal.SIGINT),
    ],
)
def test_stopped_before_its_first_shard_it_leaves_nothing_behind(good, few, tmp_path, moment, how):
    out = tmp_path / "ds"
    process = farm(good, "--out", out, *FEW)
    wait_for(lambda: MOMENTS[moment](out, process.pid) or process.poll() is not None)
    family = family_of(process.pid)
    assert process.poll() is None
    assert shards_in(out) == []
    if how == signal.SIGKILL:
        kill(process.pid)
    else:
        os.killpg(process.pid, signal.SIGINT)
    code, said = finish(process)
    assert code == (-signal.SIGKILL if how == signal.SIGKILL else 130), said
    assert "Traceback" not in said, said
    wait_for(lambda: not alive(family))
    code, said = finish(farm(good, "--out", out, *FEW))
    assert code == 0, said
    assert hashes(out) == hashes(few)
    assert verify(out) == []
    assert sorted(path.name for path in out.iterdir()) == sorted(path.name for path in few.iterdir())
    assert sorted(path.name for path in (out / "shards").iterdir()) == sorted(hashes(few))


def test_a_second_run_on_one_folder_is_refused(good, made):
    before = hashes(made)
    with FolderLock(made), pytest.raises(DatasetError, match=rf"another run is at it \(process {os.getpid()}"):
        run(good, made, **SIZE)
    run(good, made, **SIZE)
    assert hashes(made) == before


def test_the_lock_of_a_killed_run_is_free(tmp_path):
    code = "import sys, time; from pathlib import Path; from datagen.lock import FolderLock\n"
    code += "lock = FolderLock(Path(sys.argv[1])); lock.__enter__(); print('held', flush=True); time.sleep(60)"
    holder = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert holder.stdout.readline() == "held\n"
    with pytest.raises(DatasetError, match=f"process {holder.pid} on"), FolderLock(tmp_path):
        pass
    holder.kill()
    holder.wait()
    with FolderLock(tmp_path):
        pass


@pytest.mark.parametrize(("fault", "cause"), [(1, "SIGSEGV"), (2, "did not end within 8 s"), (3, "exit code 7")])
def test_only_the_guilty_systems_are_quarantined(tanks, dozen, tmp_path, fault, cause):
    bad = faulty.describe(tanks, fault=fault, above=9e-5)
    size = {**SIZE, "shard_size": 6, "timeout": 8.0}
    manifest = run(bad, tmp_path / "bad", failure_budget=0.5, **size)
    failures = [json.loads(line) for line in (tmp_path / "bad" / "failures.jsonl").read_text().splitlines()]
    innocent = DatasetFolder(dozen).load()
    guilty = [int(i) for i, (k,) in zip(innocent.systems, innocent.parameters, strict=True) if k > 9e-5]
    assert 0 < len(guilty) < 6
    assert [one["system"] for one in failures] == guilty
    assert all(cause in one["cause"] and one["parameters"]["k"] > 9e-5 and one["root_seed"] == 3 for one in failures)
    assert len(manifest.done()) == 12 - len(guilty)
    records = DatasetFolder(tmp_path / "bad").load()
    keep = [i not in guilty for i in innocent.systems]
    assert (records.values == innocent.values[keep]).all()
    assert verify(tmp_path / "bad") == []


@pytest.mark.parametrize("fault", [1, 2])
def test_processes_that_an_fmu_took_down_leave_no_unpacked_fmus(tanks, tmp_path, fault):
    bad = faulty.describe(tanks, fault=fault, above=9e-5)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    words = ["--systems", 12, "--seed", 3, "--shard-size", 6, "--workers", 2, "--timeout", 8, "--failure-budget", 0.5]
    process = farm(bad, "--out", tmp_path / "ds", *words, env={**os.environ, "TMPDIR": str(scratch)})
    code, said = finish(process)
    assert code != 0 and "1 failed" in said, said
    assert list(scratch.rglob("modelDescription.xml")) == []


def test_failures_are_tried_again_only_when_asked(tanks, tmp_path):
    bad = faulty.describe(tanks, fault=3, above=9e-5)
    manifest = run(bad, tmp_path, failure_budget=0.5, **SIZE)
    failures = (tmp_path / "failures.jsonl").read_text()
    before = {path.name: path.stat().st_mtime_ns for path in shards_in(tmp_path)}
    run(bad, tmp_path, failure_budget=0.5, **SIZE)
    assert {path.name: path.stat().st_mtime_ns for path in shards_in(tmp_path)} == before
    again = run(bad, tmp_path, failure_budget=0.5, retry_failures=True, **SIZE)
    assert (tmp_path / "failures.jsonl").read_text() == failures
    assert [e.content_hash for e in again.shards] == [e.content_hash for e in manifest.shards]
    assert {path.name: path.stat().st_mtime_ns for path in shards_in(tmp_path)} != before


def test_the_failure_budget_stops_a_run_that_goes_wrong(tanks, tmp_path):
    bad = faulty.describe(tanks, fault=3, above=2e-5)
    with pytest.raises(SimulationError, match=r"more than the failure budget of 5% of 12.*exit code 7"):
        run(bad, tmp_path, **SIZE)


def test_a_leaking_fmu_gets_fresh_workers(tanks, tmp_path):
    leaky = faulty.describe(tanks, leak=30e6)
    manifest = run(leaky, tmp_path / "leaky", recycle=100e6, **{**SIZE, "systems": 30, "workers": 1})
    assert len(manifest.done()) == 30
    assert (tmp_path / "leaky" / "failures.jsonl").read_text() == ""


def test_more_systems_by_extension_leave_the_old_shards_alone(good, tmp_path):
    run(good, tmp_path / "grown", **{**SIZE, "systems": 5})
    before = {path.name: path.stat().st_mtime_ns for path in shards_in(tmp_path / "grown")}
    with pytest.raises(DatasetError, match="--extend"):
        run(good, tmp_path / "grown", **{**SIZE, "systems": 8})
    run(good, tmp_path / "grown", extend=True, **{**SIZE, "systems": 8})
    run(good, tmp_path / "grown", **{**SIZE, "systems": 8})
    after = {path.name: path.stat().st_mtime_ns for path in shards_in(tmp_path / "grown")}
    assert {name: after[name] for name in before} == before
    run(good, tmp_path / "once", **{**SIZE, "systems": 8, "workers": 1})
    grown, once = (DatasetFolder(tmp_path / name).load() for name in ("grown", "once"))
    assert grown.systems.tolist() == list(range(8))
    assert (grown.values == once.values).all()
    assert (grown.splits == once.splits).all()
    with pytest.raises(DatasetError, match="systems is 8, this run has 5"):
        run(good, tmp_path / "grown", extend=True, **{**SIZE, "systems": 5})


def test_a_shard_that_was_written_but_not_recorded_is_adopted(good, made):
    manifest = read_manifest(made)
    write_manifest(made, manifest.model_copy(update={"shards": manifest.shards[:2]}))
    spoilt = made / "shards" / manifest.shards[-1].file
    spoilt.write_bytes(spoilt.read_bytes()[:5000])
    before = {path.name: path.stat().st_mtime_ns for path in shards_in(made)}
    run(good, made, **SIZE)
    after = {path.name: path.stat().st_mtime_ns for path in shards_in(made)}
    assert [name for name in after if after[name] != before[name]] == [spoilt.name]
    assert read_manifest(made).shards == manifest.shards


@pytest.mark.parametrize("damage", ["flip", "cut", "remove"])
def test_repair_mends_the_damaged_shard_and_no_other(made, damage):
    whole = {path.name: path.read_bytes() for path in shards_in(made)}
    times = {path.name: path.stat().st_mtime_ns for path in shards_in(made)}
    victim = made / "shards" / "shard-000002.nc"
    data = bytearray(victim.read_bytes())
    if damage == "flip":
        data[len(data) // 2] ^= 0x10
        victim.write_bytes(data)
    elif damage == "cut":
        victim.write_bytes(data[: len(data) // 2])
    else:
        victim.unlink()
    assert [victim.name in fault for fault in verify(made)] == [True]
    assert mending.repair(made) == [victim.name]
    assert {path.name: path.read_bytes() for path in shards_in(made)} == whole
    others = {path.name: path.stat().st_mtime_ns for path in shards_in(made) if path != victim}
    assert others == {name: stamp for name, stamp in times.items() if name != victim.name}
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


def test_a_full_disk_is_a_sentence_and_loses_nothing(good, small_disk, tmp_path):
    size = {**SIZE, "hours": 8760.0, "systems": 24}
    with pytest.raises(DatasetError, match=r"No space left.*same command goes on"):
        run(good, small_disk / "ds", **size)
    subprocess.run(["mount", "-o", "remount,size=64m", small_disk], check=True)
    assert all("not in the manifest" in one or "README.md: missing" in one for one in verify(small_disk / "ds"))
    run(good, small_disk / "ds", **size)
    run(good, tmp_path / "ample", **size)
    assert hashes(small_disk / "ds") == hashes(tmp_path / "ample")


def test_a_read_only_folder_is_a_sentence(good, small_disk):
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    with pytest.raises(DatasetError, match=r"cannot be written: Read-only file system"):
        run(good, small_disk / "ds", **SIZE)
