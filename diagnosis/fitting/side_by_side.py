"""Many simulations of one system: in this process, in processes of this machine, or on a Dask cluster.

One interface for all three: :meth:`Runner.map` takes runs and returns their outputs in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from datagen.simulating.simulator import Simulator
from diagnosis.fitting.failures import FAILURES, reason
from diagnosis.fitting.run import Run
from diagnosis.fitting.warmed import warmed
from shared.children import starting, worker_pool
from shared.errors import ClusterError, SimulationError, ZeroshotError
from shared.system import System

Outcome = np.ndarray | SimulationError
"""Outputs (outputs, steps) [unit of each], or why there are none."""
_ROUNDS = 32
"""Runs for each worker in one batch: at its end all but the slowest wait, for a share of it that hardly counts."""


class Runner(Protocol):
    """What runs simulations.

    It may have a ``batch``: how many runs it is given at least, if there are so many, lest a worker wait for others;
    one, if it has none.
    """

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """Outcome of each run, in order; a failed simulation is an error in its place, not an exception."""


class InProcess:
    """One after another on a simulator that is loaded already."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`Runner`."""
        return [simulate(self.simulator, run) for run in runs]


class Processes:
    """In processes of this machine, each with its own simulator."""

    def __init__(self, system: System, workers: int, pool: ProcessPoolExecutor) -> None:
        self._what = (system.canonical(), str(system.path))
        self.workers, self.batch = workers, _ROUNDS * workers
        self._pool = pool

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`Runner`."""
        parts = _parts(runs, self.workers)
        try:
            with starting():  # the first call starts the processes
                done = self._pool.map(_simulate_all, [self._what] * len(parts), parts)
            return [one for part in done for one in part]
        except BrokenProcessPool:
            raise ClusterError(
                f"one of {self.workers} processes that simulate was killed, as they are where memory runs out; expected"
                " all of them to stay. Give fewer --workers: the same command goes on from there"
            ) from None


class Cluster:
    """On the workers of a Dask client, which see the FMU under the same path as this machine."""

    def __init__(self, system: System, client: Any) -> None:
        self._what = (system.canonical(), str(system.path))
        self._client = client

    @property
    def batch(self) -> int:
        """See :class:`Runner`."""
        return _ROUNDS * self._workers

    @property
    def _workers(self) -> int:
        return max(len(self._client.scheduler_info(n_workers=-1)["workers"]), 1)

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`Runner`."""
        parts = _parts(runs, self._workers)
        futures = [self._client.submit(_simulate_all, self._what, part, pure=False) for part in parts]
        return [one for part in self._client.gather(futures) for one in part]


@contextmanager
def side_by_side(simulator: Simulator, *, workers: int | None = None, scheduler: str | None = None) -> Iterator[Runner]:
    """A runner: on a Dask cluster where a scheduler is given, in ``workers`` processes, or in this one.

    Raises
    ------
    ClusterError
        If the scheduler does not answer, there would be no worker, or both are given: a cluster has its own workers.
    """
    if workers is not None and workers < 1:
        raise ClusterError(f"workers is {workers}; expected at least 1")
    if scheduler is not None:
        from datagen.farming.cluster import connect

        with connect(workers=workers, scheduler=scheduler) as client:
            yield Cluster(simulator.system, client)
    elif workers is not None and workers > 1:
        with worker_pool(workers) as pool:
            yield Processes(simulator.system, workers, pool)
    else:
        yield InProcess(simulator)


def simulate(simulator: Simulator, run: Run) -> Outcome:
    """Simulate one run."""
    try:
        return warmed(simulator).outputs(run)
    except SimulationError as error:
        return error
    except (ZeroshotError, *FAILURES) as error:  # such as a discrete input that an effect has bent
        return SimulationError(reason(error))


def _parts(runs: Sequence[Run], workers: int) -> list[list[Run]]:
    """Consecutive parts, a few for each worker, so that none waits long for another."""
    count = max(min(4 * workers, len(runs)), 1)
    edges = np.linspace(0, len(runs), count + 1).round().astype(int)
    return [list(runs[a:b]) for a, b in pairwise(edges) if b > a]


def _simulate_all(what: tuple[str, str], runs: Sequence[Run]) -> list[Outcome]:
    from datagen.farming.worker import simulator_for  # with distributed, which only workers need

    simulator = simulator_for(*what)
    if simulator is None:
        return [SimulationError(f"{what[1]}: its FMU is not on this worker; expected the same path")] * len(runs)
    return [simulate(simulator, run) for run in runs]
