"""Jobs of a queue, kept at their number: one that has ended is submitted again, one that was refused is tried again.

Dask's own scaling takes a job for there until it is told otherwise, which it is of jobs with one worker only; and what
a queue says when it refuses a job, it shows as a traceback.
"""

from __future__ import annotations

import time
from typing import Any

from distributed import Scheduler, SchedulerPlugin
from distributed.core import Status
from tornado.ioloop import PeriodicCallback

from shared.errors import ClusterError
from shared.logs import logger

LOOK = 10.0
"""Seconds between two looks."""
LOST = 180.0
"""Seconds after which a job that had workers and has none has ended: one that is replaced within its job is back
before, also on a slow file system."""
AGAIN = 60.0
"""Seconds after which a submission that was refused is tried again."""
SAY = 600.0
"""Seconds without any worker after which that is said, each time anew."""
_log = logger(__name__)


class Keeper(SchedulerPlugin):
    """Keeps so many jobs of a cluster of dask-jobqueue's.

    ``where`` says where the jobs' output is found, to be told when no worker comes.
    """

    def __init__(self, cluster: Any, jobs: int, where: str | None) -> None:
        self._cluster = cluster
        self._jobs = jobs
        self._where = where
        self._seen: dict[str, float] = {}  # each worker last [s]
        self._refused = -AGAIN
        self._any = time.monotonic()

    def begin(self) -> None:
        """Submit the jobs, and look after them as long as the cluster lasts.

        Raises ClusterError if the queue takes none of them; the cluster is closed then.
        """
        words = self._cluster.sync(self._submit)
        if words and all(job.job_id is None for job in self._cluster.workers.values()):
            self._cluster.close()
            raise ClusterError(f"the queue took no job: {words}; expected a queue, an account and sizes that it knows")
        self._cluster.scheduler.add_plugin(self)
        self._cluster.loop.add_callback(PeriodicCallback(self._look, LOOK * 1000).start)

    def add_worker(self, scheduler: Scheduler, worker: str) -> None:
        """Dask tells of a new worker: one that lives shorter than it takes until the next look has been there, too."""
        self._seen[str(scheduler.workers[worker].name)] = time.monotonic()

    async def _submit(self) -> str:
        """Submit the jobs that are missing; returns what the queue says where it refuses one.

        Dask's own ``scale`` does the same in the background, where nobody hears of a refusal.
        """
        spec = self._cluster.worker_spec
        while len(spec) < self._jobs:
            spec.update(self._cluster.new_worker_spec())
        try:
            await self._cluster._correct_state()
        except RuntimeError as error:
            self._refused = time.monotonic()
            for job in self._cluster.workers.values():
                if job.job_id is None:
                    job.status = Status.failed
            words = " ".join(str(error).partition("stderr:")[2].split()) or str(error).partition("\n")[0]
            _log.warning("the queue refused a job: %s; tried again in %g s", words, AGAIN)
            return words
        return ""

    async def _look(self) -> None:
        cluster, now = self._cluster, time.monotonic()
        if cluster.status is not Status.running:
            return
        there = {str(one.name) for one in cluster.scheduler.workers.values()}
        if there:
            self._any = now
        elif now - self._any > SAY:
            self._any = now
            _log.warning(
                "no worker for %g min, of %d jobs that are asked for; the queue may say why, or they, in %s",
                *(SAY / 60, self._jobs, self._where or "the folder of this command"),
            )
        self._seen |= dict.fromkeys(there, now)
        for name in [*cluster.workers]:
            own = {f"{name}{suffix}" for suffix in cluster.worker_spec[name].get("group", [""])}
            if self._ended(name, own, now):
                job = cluster.workers.pop(name)
                await job.close()
                job.status = Status.closed  # its own class does not say so, and Dask asks at the end
                for one in own & {*self._seen}:
                    del self._seen[one]
        if len(cluster.workers) < self._jobs:
            await self._submit()

    def _ended(self, name: str, own: set[str], now: float) -> bool:
        """Whether a job was refused long enough ago, or has lost its workers; one that never had any may be queued."""
        if self._cluster.workers[name].job_id is None:
            return now - self._refused > AGAIN
        times = [self._seen[one] for one in own if one in self._seen]
        return bool(times) and now - max(times) > LOST
