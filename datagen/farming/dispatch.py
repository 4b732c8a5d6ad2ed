"""Bounded work in flight: hands tasks to the workers a few at a time, and yields what comes back.

A plan of a million systems never becomes a million futures; the bound follows the number of workers as they come and
go.
"""

from __future__ import annotations

import queue
import time
from collections import deque
from collections.abc import Callable, Iterator, Set
from typing import Any, Generic, TypeVar
from uuid import uuid4

from dask.distributed import Client, Future

from shared.errors import SimulationError

PER_WORKER = 3
"""Tasks in flight for each worker: one at work, one waiting there, one on its way."""
PATIENCE = 300.0
"""Seconds without any worker after which a run stops."""
_LOOK = 2.0
_FETCH = 60.0
"""Seconds in which a finished task's result, some megabytes at most, is here."""

Task = TypeVar("Task")


class Dispatcher(Generic[Task]):
    """Iterate over it to get each task of ``source`` with its result, or with the exception in place of one.

    A worker calls ``function(*arguments(task))``. ``avoided`` are addresses of workers that a task goes to only where
    there is no other.
    """

    def __init__(
        self,
        client: Client,
        function: Callable[..., Any],
        arguments: Callable[[Task], tuple[Any, ...]],
        source: Iterator[Task],
        *,
        patience: float = PATIENCE,
        avoided: Callable[[Task], Set[str]] = lambda _: frozenset(),
    ) -> None:
        self._client = client
        self._function = function
        self._arguments = arguments
        self._source = source
        self._patience = patience
        self._avoided = avoided
        self._workers: set[str] = set()
        self._again: deque[Task] = deque()
        self._alone: deque[Task] = deque()
        self._flying: dict[str, tuple[Task, Future]] = {}
        self._bound: dict[str, set[str]] = {}
        """the workers that a task in flight may go to, where these are not all"""
        self._landed: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._single = False
        """whether the one in flight is to stay alone"""
        self._run = uuid4().hex[:12]
        self._submitted = 0
        self._limit = 0
        self._looked = -_LOOK
        self._seen = time.monotonic()

    def again(self, task: Task, *, alone: bool = False) -> None:
        """Put a task in line once more, before all others; ``alone`` with no other in flight."""
        (self._alone if alone else self._again).append(task)

    def __iter__(self) -> Iterator[tuple[Task, Any]]:
        while True:
            self._look()
            if self._alone:
                if self._limit and not self._flying:
                    self._send(self._alone.popleft())
                    self._single = True
            elif not self._single:
                while len(self._flying) < self._limit and self._submit():
                    pass
            if not self._flying and not self._again and not self._alone:
                if self._limit:
                    return
                time.sleep(0.2)
                continue
            try:
                key = self._landed.get(timeout=_LOOK)
            except queue.Empty:
                continue
            if key not in self._flying:  # it was called back
                continue
            try:
                outcome = self._outcome(self._flying[key][1])
            except TimeoutError:  # its worker is gone, and somebody else works it out: another message comes
                self._await(key)
                continue
            # the future goes with it: a worker leaves in order only when nobody wants anything of it any more
            task, _ = self._flying.pop(key)
            self._bound.pop(key, None)
            self._single = False
            yield task, outcome

    def _submit(self) -> bool:
        task = self._again.popleft() if self._again else next(self._source, None)
        if task is None:
            return False
        self._send(task)
        return True

    def _send(self, task: Task) -> None:
        self._submitted += 1
        # the key is of this run alone: several runs may share a scheduler
        key = f"shard-{self._run}-{self._submitted}"
        others = self._workers - avoided if (avoided := self._avoided(task)) else set()
        where: dict[str, Any] = {}
        if others:
            # with allow_other_workers, Dask lets an avoided worker that is idle take the task back from them
            where = {"workers": sorted(others), "allow_other_workers": False}
            self._bound[key] = others
        future = self._client.submit(self._function, *self._arguments(task), key=key, pure=False, **where)
        self._flying[key] = (task, future)
        self._await(key)

    def _await(self, key: str) -> None:
        self._flying[key][1].add_done_callback(lambda _: self._landed.put(key))

    def _outcome(self, future: Future) -> Any:
        if future.status == "cancelled":
            raise SimulationError("the scheduler went away; what was finished is kept, run again to go on")
        try:
            return future.result(timeout=_FETCH)
        except TimeoutError as error:
            if future.status != "error":
                raise
            return error
        except Exception as error:
            return error

    def _look(self) -> None:
        """Follow the number of workers."""
        now = time.monotonic()
        if now - self._looked < _LOOK:
            return
        self._looked = now
        if self._client.status not in ("running", "connecting"):
            raise SimulationError("the scheduler went away; what was finished is kept, run again to go on")
        self._workers = {*self._client.scheduler_info(n_workers=-1)["workers"]}
        if self._workers:
            self._seen = now
            self._limit = PER_WORKER * len(self._workers)
            self._call_back()
        elif now - self._seen > self._patience:
            raise SimulationError(
                f"no worker for {self._patience:g} s; what was finished is kept, run again when there are workers"
            )

    def _call_back(self) -> None:
        """Put tasks that wait for workers which are gone in line again."""
        for key in [key for key, others in self._bound.items() if not others & self._workers]:
            del self._bound[key]
            task, future = self._flying.pop(key)
            future.cancel()
            self.again(task, alone=self._single)
            self._single = False
