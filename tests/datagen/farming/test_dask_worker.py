"""Workers that can do nothing, or go: others take their shards, with Dask's own scheduler."""

import functools
import threading
import time

import dask
import pytest
from dask.distributed import Client, LocalCluster

from datagen.farming.collection import Collection
from datagen.farming.dask_settings import SETTINGS
from datagen.farming.dask_worker import address, named
from datagen.farming.dispatch import Dispatcher
from datagen.farming.failures import Failures
from datagen.farming.plan import Piece
from datagen.farming.worker import ShardResult
from shared.manifest import Manifest
from tests.datagen.faults import wait_for

pytestmark = pytest.mark.slow


def all_but(place, *_):
    """A shard that one worker refuses at once, as one with a full disk does, and others take their time for."""
    with named():
        if address() == place:
            raise OSError(28, "No space left on device")
    time.sleep(0.2)
    return ShardResult(worker=address())


def test_one_worker_that_can_do_nothing_leaves_all_to_the_others(tmp_path, monkeypatch):
    manifest = Manifest(
        **dict.fromkeys(("system_name", "system_hash", "system", "fmu_sha256"), "x"),
        **{"root_seed": 1, "systems": 12, "shard_size": 1},
    )
    (tmp_path / "shards").mkdir()
    local = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with dask.config.set(SETTINGS), LocalCluster(**local) as cluster, Client(cluster, set_as_default=False) as client:
        bad, good = sorted(client.scheduler_info(n_workers=-1)["workers"])
        made = Collection(tmp_path, manifest, Failures([]), None, None, budget=1.0)
        taken = []
        monkeypatch.setattr("datagen.farming.collection.simulate_shard", functools.partial(all_but, bad))
        monkeypatch.setattr(made, "take", lambda piece, result: taken.append((piece.file, result.worker)))
        monkeypatch.setattr(made, "_count", lambda: 0)
        made.collect(client, iter([Piece(f"s{k}", (k,), 1) for k in range(12)]), quiet=True)
    assert sorted(taken) == sorted((f"s{k}", good) for k in range(12))


def where_it_was(seconds):
    time.sleep(seconds)
    return address()


def test_a_task_whose_other_workers_are_gone_goes_to_the_one_that_it_avoided():
    local = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with dask.config.set(SETTINGS), LocalCluster(**local) as cluster, Client(cluster, set_as_default=False) as client:
        bad, good = sorted(client.scheduler_info(n_workers=-1)["workers"])
        busy = client.submit(time.sleep, 3.0, workers=[good])
        wait_for(lambda: client.processing()[good])
        flight = Dispatcher(client, where_it_was, lambda task: (task,), iter([]), avoided=lambda _: {bad})
        for task in (0.0, 0.1):
            flight.again(task, alone=task > 0)
        begun = iter(flight)
        gone = threading.Timer(0.3, client.retire_workers, kwargs={"workers": [good], "close_workers": True})
        gone.start()
        busy.release()
        assert sorted(begun) == [(0.0, bad), (0.1, bad)]
        gone.join()
