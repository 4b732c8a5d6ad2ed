"""Workers: on this machine, behind a scheduler that runs already, or as jobs of a queue.

Whatever listens, listens on loopback unless told otherwise: a scheduler runs any code that reaches it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any

import dask
from dask.distributed import Client, LocalCluster

from datagen.dispatch import PATIENCE
from datagen.slurm import slurm
from shared.errors import ClusterError
from shared.interrupts import interrupts_held
from shared.logs import fields, logger

_PACKAGE = "zeroshot-fmu"
LOOPBACK = "127.0.0.1"
_log = logger(__name__)
QUEUES = {"slurm": slurm}
"""Kinds of cluster whose workers are jobs of a queue: each makes one of so many jobs, from the users' options and the
scheduler's own."""
_CONFIG = {
    # a shard whose worker died comes back at once: the farm itself finds out whose fault it was
    "distributed.scheduler.allowed-failures": 0,
    # an FMU may hold the interpreter for minutes; hanging is for the per-system timeout to judge
    "distributed.scheduler.worker-ttl": None,
    # a worker above its share of memory is ended, never paused for good
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
}


@contextmanager
def connect(
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    cluster: str = "local",
    options: Mapping[str, str] | None = None,
    host: str | None = None,
) -> Iterator[Client]:
    """A Dask client with workers behind it, all of this version.

    Parameters
    ----------
    workers
        Processes of a local cluster (by default one a core), or jobs of a queue.
    scheduler
        Address of a scheduler that runs already, in place of a cluster of our own.
    cluster
        ``local``, or one of :data:`QUEUES`.
    options
        Of a job: ``queue``, ``account``, ``walltime``, ``memory``, ``cores``, ``interface``, ...
    host
        Address that our own scheduler listens on; loopback by default.

    Raises
    ------
    ClusterError
        If the scheduler does not answer, a worker has another version of this package, or a package is missing.
    """
    if cluster not in ("local", *QUEUES):
        raise ClusterError(f"cluster is {cluster!r}; expected {' or '.join(['local', *QUEUES])}")
    if scheduler:
        try:
            client = _client(scheduler, timeout=20)
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: TLS on one side only
            raise ClusterError(
                f"{scheduler}: no Dask scheduler answers: {error}; expected tcp://HOST:PORT, or tls://HOST:PORT with"
                " certificates set"
            ) from None
        with client:
            if not _count(client):
                _log.info("waiting for a worker at %s", scheduler)
                _wait(client, scheduler)
            _check_versions(client)
            _say(_count(client), client.dashboard_link)
            yield client
        return
    with dask.config.set(_CONFIG):
        if cluster in QUEUES:
            listening = {"host": host or LOOPBACK, "dashboard_address": f"{LOOPBACK}:0"}
            with QUEUES[cluster](workers or 1, dict(options or {}), listening) as running, _client(running) as client:
                _log.info("waiting for the first worker of %s; dashboard at %s", cluster, running.dashboard_link)
                client.wait_for_workers(1)
                _check_versions(client)
                yield client
            return
        with interrupts_held():
            running = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=host or LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",
                silence_logs=50,
            )
        ended = False
        try:
            with running, _client(running) as client:
                _say(len(running.workers), running.dashboard_link)
                yield client
                ended = True
        except TimeoutError:
            if not ended:
                raise
            # all that was asked for is there; on a busy machine Dask gives up waiting for its own processes
            _log.warning("the workers had not ended when Dask stopped waiting for them")


def _client(where: Any, **options: Any) -> Client:
    """A client that is nobody's default: one whose scheduler is gone would stay what Dask and xarray ask for locks."""
    return Client(where, set_as_default=False, **options)


def _say(workers: int, dashboard: str) -> None:
    _log.info("%d workers; dashboard at %s", workers, dashboard, extra=fields(workers=workers, dashboard=dashboard))


def _wait(client: Client, scheduler: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise ClusterError(f"{scheduler}: no worker came within {PATIENCE:g} s; start some and run again") from None


def _count(client: Client) -> int:
    return len(client.scheduler_info(n_workers=-1)["workers"])


def _check_versions(client: Client) -> None:
    """Refuse workers with another version of this package; one that joins later is refused by its first shard."""
    ours = version(_PACKAGE)
    versions: Any = client.get_versions(packages=[_PACKAGE])
    for address, found in versions["workers"].items():
        theirs = found["packages"].get(_PACKAGE)
        if theirs != ours:
            has = f"{_PACKAGE} {theirs}" if theirs else f"no {_PACKAGE}"
            raise ClusterError(f"worker {address} has {has}, this run {ours}; expected the same version everywhere")
