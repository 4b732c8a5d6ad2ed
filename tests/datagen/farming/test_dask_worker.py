"""A worker that goes, with Dask's own processes: a fresh one takes its place, and no shard is blamed for it."""

import asyncio
import os
import time

import dask
import pytest
from dask.distributed import Client, LocalCluster
from distributed.scheduler import Scheduler

from datagen.farming.dask_settings import OWN_CLUSTER, SETTINGS
from datagen.farming.dask_worker import recycle
from tests.datagen.faults import wait_for

pytestmark = pytest.mark.slow


def leave():
    recycle(0.0, 1)
    return os.getpid()


def stay(seconds):
    time.sleep(seconds)
    return os.getpid()


@pytest.fixture
def client():
    local = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 60}
    settings = dask.config.set(SETTINGS | OWN_CLUSTER)
    with settings, LocalCluster(**local) as cluster, Client(cluster, set_as_default=False) as client:
        yield client


def test_a_heartbeat_while_it_goes_does_not_close_its_nanny(client, monkeypatch):
    """The scheduler has let it go and says so late, as on a busy machine; heartbeats come twice a second."""
    remove = Scheduler.remove_worker

    async def late(self, address, **words):
        removed = await remove(self, address, **words)
        await asyncio.sleep(1.2 if words.get("expected") else 0.0)
        return removed

    monkeypatch.setattr(Scheduler, "remove_worker", late)
    before = client.submit(leave, pure=False).result()
    (nanny,) = client.cluster.workers.values()
    wait_for(lambda: nanny.status.name != "running" or nanny.pid not in (before, None))
    assert client.submit(stay, 0.0, pure=False).result(timeout=60) != before


def test_what_waits_with_it_is_done_by_the_next_one(client):
    """No worker has died over it, though none may fail."""
    before = client.submit(leave, pure=False).result()
    waiting = [client.submit(stay, 2.0, pure=False) for _ in range(2)]
    assert before not in [one.result(timeout=60) for one in waiting[1:]]
