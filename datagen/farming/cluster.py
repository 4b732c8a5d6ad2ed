"""Workers: on this machine, behind a scheduler that runs already, or as jobs of a queue.

Whatever listens, listens on loopback unless told otherwise: a scheduler runs any code that reaches it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import dask
from dask.distributed import Client, LocalCluster
from dask.utils import parse_timedelta
from distributed.comm.addressing import parse_address, parse_host_port
from distributed.comm.registry import backends
from distributed.security import Security

from datagen.farming.dask_settings import OWN_CLUSTER, SETTINGS
from datagen.farming.dispatch import PATIENCE
from datagen.farming.slurm import slurm
from datagen.farming.versions import DECIDING, PACKAGE, deciding_here, difference
from shared.children import without_script
from shared.errors import ClusterError
from shared.interrupts import interrupts_held
from shared.logs import fields, logger

LOOPBACK = "127.0.0.1"
_log = logger(__name__)
QUEUES = {"slurm": slurm}
"""Kinds of cluster whose workers are jobs of a queue: each makes one of so many jobs, from the users' options and the
scheduler's own."""
_CONFIG = SETTINGS
_MOST_WORKERS = 100_000
"""More than any cluster starts; Dask would try for ever."""
_EXPECTED = "tcp://HOST:PORT, or tls://HOST:PORT with certificates set"
ANSWER = 20.0
"""A scheduler that runs already answers within so long [s]."""


def check_places(
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    cluster: str = "local",
    options: Mapping[str, str] | None = None,
    host: str | None = None,
) -> None:
    """Refuse what :func:`connect` could not start, or would wait for in vain; the parameters are its own.

    Raises ClusterError if the kind of cluster is unknown, a place has an empty name, there would be no worker, jobs on
    other nodes would not reach us, or one thing is given that another has no use for.
    """
    interface = (options or {}).get("interface")
    for what, name in (("host", host), ("scheduler", scheduler), ("cluster option interface", interface)):
        if name is not None and not name.strip():  # a shell's variable that is not set
            raise ClusterError(f"{what} is {name!r}; expected its address or name, or none given at all")
    if cluster not in ("local", *QUEUES):
        raise ClusterError(f"cluster is {cluster!r}; expected {' or '.join(['local', *QUEUES])}")
    if workers is not None and not 1 <= workers <= _MOST_WORKERS:
        raise ClusterError(
            f"workers is {workers}; expected at least 1{'' if workers < 1 else f', at most {_MOST_WORKERS}'}"
        )
    if scheduler:
        _check_address(scheduler)
    given = {"workers": workers is not None, "host": host is not None, "cluster": cluster != "local"}
    if scheduler and (beside := [name for name, one in given.items() if one]):
        raise ClusterError(
            f"scheduler is {scheduler!r} and {beside[0]} is given; expected one of both: a scheduler that runs already"
            " has workers of its own"
        )
    if options and cluster not in QUEUES:
        raise ClusterError(
            f"cluster options {', '.join(options)} are given and no cluster; expected --cluster {' or '.join(QUEUES)}"
            " with them, or none of them"
        )
    if cluster in QUEUES and host is None and interface is None:
        raise ClusterError(
            f"cluster {cluster}: neither an interface nor a host is given, and jobs on other nodes do not reach "
            f"{LOOPBACK}; expected --cluster-option interface=NAME or --host ADDRESS of this machine in the nodes' "
            f"network, or --host {LOOPBACK} where all jobs run on this machine"
        )


def _check_address(scheduler: str) -> None:
    """Refuse what is no address before Dask does: its client would be cleared away with a traceback, 40 s later."""
    try:
        scheme, place = parse_address(scheduler)
        parse_host_port(place)
        if scheme not in backends:
            raise ValueError(f"no Dask scheduler talks {scheme}://")
        if scheme == "tls" and Security().get_connection_args("client").get("ssl_context") is None:
            raise ValueError("no certificates are set")
    except ValueError as error:
        raise ClusterError(f"scheduler is {scheduler!r}: {error}; expected {_EXPECTED}") from None


@contextmanager
def connect(
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    cluster: str = "local",
    options: Mapping[str, str] | None = None,
    host: str | None = None,
) -> Iterator[Client]:
    """A Dask client with workers behind it, all with the versions of here.

    Raises ClusterError if what is asked for cannot be started, the scheduler does not answer or is lost, a worker has
    another version of what decides a simulation's numbers, or a package is missing.

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
        Address that our own scheduler listens on; loopback by default, but for a queue to be given.
    """
    check_places(workers=workers, scheduler=scheduler, cluster=cluster, options=options, host=host)
    if scheduler:
        try:
            client = _client(scheduler, timeout=_patience())
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: TLS on one side only
            raise ClusterError(f"{scheduler}: no Dask scheduler answers: {error}; expected {_EXPECTED}") from None
        with client, _held(scheduler):
            if not _count(client):
                _log.info("waiting for a worker at %s", scheduler)
                _wait(client, scheduler)
            _check_versions(client)
            _say(_count(client), client.dashboard_link)
            yield client
        return
    listening = {"host": host or LOOPBACK, "dashboard_address": f"{LOOPBACK}:0"}
    failure: BaseException | None = None
    try:
        # a worker that leaves, or dies, is replaced at any time
        with dask.config.set(_CONFIG | OWN_CLUSTER), without_script(), ExitStack() as stack:
            try:
                with _starting(cluster, host):
                    if cluster in QUEUES:
                        running = QUEUES[cluster](workers or 1, dict(options or {}), listening)
                    else:
                        running = _local(workers, listening)
                    client = stack.enter_context(_client(stack.enter_context(running)))
                with _held(f"cluster {cluster}"):
                    if cluster in QUEUES:
                        _log.info(
                            "waiting for the first worker of %s; scheduler at %s, dashboard at %s",
                            *(cluster, running.scheduler_address, running.dashboard_link),
                        )
                        client.wait_for_workers(1)
                        _check_versions(client)
                    else:
                        _say(len(running.workers), running.dashboard_link)
                    yield client
            except BaseException as error:
                failure = error
                raise
    except TimeoutError:
        if failure is not None:  # that is what is to be said, not what came of it
            raise failure from None
        # all that was asked for is there; on a busy machine Dask gives up waiting for its own processes
        _log.warning("the workers had not ended when Dask stopped waiting for them")


def _local(workers: int | None, listening: dict[str, str]) -> LocalCluster:
    with interrupts_held():
        return LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, silence_logs=50, **listening)


@contextmanager
def _starting(cluster: str, host: str | None) -> Iterator[None]:
    """Say in a sentence why a cluster of our own does not start."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        cause: BaseException = error
        while cause.__cause__ is not None:  # Dask's own words tell but that something has failed
            cause = cause.__cause__
        hint = f"host is {host!r}; expected an address of this machine" if host else "run again to go on"
        raise ClusterError(f"cluster {cluster} did not start: {_words(cause)}; {hint}") from None


@contextmanager
def _held(what: str) -> Iterator[None]:
    """Say in a sentence that the connection is lost: to Dask that is an OSError, as if a file could not be written."""
    try:
        yield
    except OSError as error:
        if error.errno is not None:  # a file system's; those of Dask's connections have none
            raise
        raise ClusterError(
            f"{what}: the connection to the scheduler was lost: {_words(error)}; what was finished is kept, run again "
            "to go on"
        ) from None


def _words(error: BaseException) -> str:
    return str(error) or type(error).__name__


def _patience() -> float:
    """How long we wait for a scheduler that runs already [s]: Dask's own setting, where it is shorter."""
    return min(ANSWER, float(parse_timedelta(dask.config.get("distributed.comm.timeouts.connect"))))


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
    """Refuse workers whose numbers would not be ours; one that joins later is refused by its first shard."""
    found: Any = client.get_versions(packages=DECIDING)
    if not found["scheduler"]["packages"].get(PACKAGE):  # it unpacks what it hands on
        raise ClusterError(
            f"the scheduler has no {PACKAGE}, this run {deciding_here()[PACKAGE]}; expected the same there, too"
        )
    for address, one in found["workers"].items():
        other = difference(one["packages"], deciding_here())
        if other is not None:
            raise ClusterError(
                f"worker {address} has {other[0]}, this run {other[1]}; expected the same version everywhere"
            )
