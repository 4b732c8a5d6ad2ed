"""Workers: on this machine, behind a scheduler that runs already, or as jobs of Slurm.

Whatever listens, listens on loopback unless told otherwise: a scheduler runs any code that reaches it.
"""

from __future__ import annotations

import signal
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

import dask
from dask.distributed import Client, LocalCluster
from rich.console import Console

from datagen.dispatch import PATIENCE
from shared.errors import ZeroshotError

_PACKAGE = "zeroshot-fmu"
LOOPBACK = "127.0.0.1"
CLUSTERS = ("local", "slurm")
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


class ClusterError(ZeroshotError):
    """Workers cannot be had: a wrong address, another version, a missing package."""


@contextmanager
def connect(
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    cluster: str = "local",
    options: Mapping[str, str] | None = None,
    host: str | None = None,
    quiet: bool = False,
) -> Iterator[Client]:
    """A Dask client with workers behind it, all of this version.

    Parameters
    ----------
    workers
        Processes of a local cluster (by default one a core), or jobs of Slurm.
    scheduler
        Address of a scheduler that runs already, in place of a cluster of our own.
    cluster
        ``local`` or ``slurm``.
    options
        Of a Slurm job: ``queue``, ``account``, ``walltime``, ``memory``, ``cores``, ``interface``, ...
    host
        Address that our own scheduler listens on; loopback by default.

    Raises
    ------
    ClusterError
        If the scheduler does not answer, a worker has another version of this package, or a package is missing.
    """
    if cluster not in CLUSTERS:
        raise ClusterError(f"cluster is {cluster!r}; expected {' or '.join(CLUSTERS)}")
    say = Console(quiet=quiet, highlight=False, soft_wrap=True)
    if scheduler:
        try:
            client = Client(scheduler, timeout=20)
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: TLS on one side only
            raise ClusterError(
                f"{scheduler}: no Dask scheduler answers: {error}; expected tcp://HOST:PORT, or tls://HOST:PORT with"
                " certificates set"
            ) from None
        with client:
            if not _count(client):
                say.print(f"waiting for a worker at {scheduler}", markup=False)
                _wait(client, scheduler)
            _check_versions(client)
            say.print(f"{_count(client)} workers; dashboard at {client.dashboard_link}", markup=False)
            yield client
        return
    with dask.config.set(_CONFIG):
        if cluster == "slurm":
            with _slurm(workers or 1, dict(options or {}), host) as running, Client(running) as client:
                say.print(f"waiting for Slurm's first worker; dashboard at {running.dashboard_link}", markup=False)
                client.wait_for_workers(1)
                _check_versions(client)
                yield client
            return
        with _interrupts_held():
            running = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=host or LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",
                silence_logs=50,
            )
        with running, Client(running) as client:
            say.print(f"{len(running.workers)} workers; dashboard at {running.dashboard_link}", markup=False)
            yield client


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back while workers start: they inherit that for good, and only this process answers to it."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # its start would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _slurm(jobs: int, options: dict[str, str], host: str | None) -> Any:
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise ClusterError("cluster slurm needs dask-jobqueue; install zeroshot-fmu[cluster]") from None
    interface = options.pop("interface", None)
    cores = int(options.pop("cores", "1"))
    scheduler_options: dict[str, Any] = {"dashboard_address": f"{LOOPBACK}:0"}
    if interface is None:
        scheduler_options["host"] = host or LOOPBACK
    settings: dict[str, Any] = {"memory": "2GiB", "walltime": "24:00:00", **options}
    try:
        cluster = SLURMCluster(
            cores=cores,
            processes=cores,
            interface=interface,
            scheduler_options=scheduler_options,
            log_directory=str(Path(tempfile.gettempdir()) / "zeroshot-slurm"),
            silence_logs="error",
            **settings,
        )
    except (TypeError, ValueError) as error:
        raise ClusterError(f"cluster options: {error}; expected those of dask_jobqueue.SLURMCluster") from None
    # a job that ends, by its wall time or otherwise, is replaced
    cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs, interval="5s")
    return cluster


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
