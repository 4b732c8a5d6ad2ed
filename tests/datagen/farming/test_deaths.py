"""Workers that die: whose fault it was, and who only waited beside it."""

import queue
from types import SimpleNamespace

import pytest
from dask.distributed import KilledWorker

from datagen.farming.collection import Collection
from datagen.farming.failures import Failures
from datagen.farming.plan import Piece
from datagen.farming.worker import ShardResult
from shared.errors import SimulationError
from shared.manifest import Manifest
from tests.datagen.faults import failing, run_here

BEHIND = 2
"""Shards that a worker has: the one at work, and one that waits."""


class Future:
    def __init__(self, work):
        self.work, self.status = work, "finished"

    def add_done_callback(self, call):
        self.call = call

    def result(self, timeout):
        assert timeout > 0
        if isinstance(self.outcome, Exception):
            raise self.outcome
        return self.outcome


class Client:
    """One worker, as Dask has it: where it dies, all that is with it is lost. ``dies(file, guarded)`` says when."""

    status = "running"

    def __init__(self, monkeypatch, dies):
        self.line, self.dies, self.deaths = [], dies, 0
        self.tries = []
        monkeypatch.setattr(queue, "SimpleQueue", lambda: SimpleNamespace(put=self.landed, get=self.next))
        self.done = []

    def scheduler_info(self, **_):
        return {"workers": {"one": {}}}

    def submit(self, _, *arguments, **__):
        future = Future(arguments)
        self.line.append(future)
        return future

    def landed(self, key):
        self.done.append(key)

    def next(self, **_):
        while not self.done:
            _, target, _, guarded = self.line[0].work
            self.tries.append((target, guarded, len(self.line)))
            if self.dies(target, guarded):
                self.deaths += 1
                lost, self.line = self.line[:BEHIND], self.line[BEHIND:]
                for one in lost:
                    one.outcome = KilledWorker("shard", SimpleNamespace(address="tcp://one"), 0)
                    one.call(one)
            else:
                one = self.line.pop(0)
                one.outcome = ShardResult(None, [])
                one.call(one)
        return self.done.pop(0)


@pytest.fixture
def collected(tmp_path, monkeypatch):
    """``collected(files, dies)``: has shards simulated by one worker; returns the client."""

    def collect(files, dies):
        manifest = Manifest(
            **dict.fromkeys(("system_name", "system_hash", "system", "fmu_sha256"), "x"),
            **{"root_seed": 1, "systems": len(files), "shard_size": 1},
        )
        (tmp_path / "shards").mkdir()
        client = Client(monkeypatch, dies)
        job, system = SimpleNamespace(package="p"), SimpleNamespace(path=tmp_path / "mine" / "system.toml")
        made = Collection(tmp_path, manifest, Failures([]), job, system, budget=1.0)
        monkeypatch.setattr(made, "_count", lambda: 0)
        monkeypatch.setattr(made, "take", lambda piece, _: client.tries.append(piece.file))
        made.collect(client, iter([Piece(file, (k,), 1) for k, file in enumerate(files)]), quiet=True)
        return client

    return collect


def test_a_shard_that_only_waited_beside_others_does_not_end_the_run(collected):
    """Every other one takes its worker down unless it is guarded; those between them wait behind it."""
    files = [f"{'bad' if k % 2 == 0 else 'good'}-{k:02d}" for k in range(60)]
    client = collected(files, lambda file, guarded: file.startswith("bad") and not guarded)
    assert {one for one in client.tries if isinstance(one, str)} == set(files)
    assert client.deaths == 30


def test_a_shard_that_kills_its_worker_under_guard_as_well_ends_the_run(collected):
    tries = []

    def dies(file, guarded):
        tries.append((file, guarded))
        return file == "bad"

    with pytest.raises(SimulationError, match=r"^bad: 4 workers died over it, the last at tcp://one, though its FMU"):
        collected(["good", "bad", "fine", "other"], dies)
    assert [guarded for file, guarded in tries if file == "bad"] == [False, True, True, True, True]


@pytest.mark.slow
def test_an_early_stop_says_what_it_found_and_does_not_bar_a_retry(tank, tmp_path, monkeypatch):
    failing(monkeypatch, *range(6), *range(10, 15))
    settings = {"systems": 40, "seed": 3, "shard_size": 10, "hours": 1.0, "failure_budget": 0.4}
    with pytest.raises(SimulationError, match=r"ds: 11 of the 20 systems that this run has tried failed; expected"):
        run_here(tank, tmp_path / "ds", **settings)
    assert len(run_here(tank, tmp_path / "ds", **settings).shards) == 4  # those that are left do not fail
    again = run_here(tank, tmp_path / "ds", retry_failures=True, **settings)  # nor do so many more
    assert len(again.done()) == 29
    assert "29 of 40 systems" in (tmp_path / "ds" / "README.md").read_text()
