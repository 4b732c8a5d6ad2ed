"""Taking shards in: records what comes back from the workers, judges what went wrong, and says how far it is."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from dask.distributed import Client, KilledWorker

from datagen.farming.dispatch import PATIENCE, PER_WORKER, Dispatcher
from datagen.farming.failures import Failures
from datagen.farming.package import package_files, receive
from datagen.farming.plan import Piece
from datagen.farming.worker import Job, ShardResult, simulate_shard
from shared.errors import SimulationError
from shared.logs import fields, logger
from shared.progress import progress_bar
from shared.store import Manifest, ShardEntry, sha256_of, write_atomically, write_manifest
from shared.system import System

FAILURE_BUDGET = 0.05
"""Share of systems that may fail before a run is stopped."""
MANIFEST_EVERY = 5.0
"""Seconds between two writes of the manifest, at least; a shard between two of them is adopted by the next run."""
_DEATHS = 4
"""A shard under guard cannot take its worker down. If its workers still die so often, it is not the FMU."""
_AT_ONCE = 100
"""Shards looked at ahead for what is to be simulated again: a large manifest is then not written for each of them."""
_EARLY = 20
"""Systems after which a run stops if more than half have failed, whatever the budget."""


_log = logger(__name__)


@dataclass
class _Task:
    piece: Piece
    deaths: int = 0


class Collection:
    """Collects the shards of one dataset.

    Parameters
    ----------
    budget
        Share of the systems that may fail.
    """

    def __init__(
        self, folder: Path, manifest: Manifest, failures: Failures, job: Job, system: System, *, budget: float
    ) -> None:
        self.folder = folder
        self.manifest = manifest
        self.failures = failures
        self.job = job
        self.system = system
        self.budget = budget
        self._entries = {entry.file: entry for entry in manifest.shards}
        self._waiting: dict[str, ShardEntry] = {}  # withdrawn, but no worker has been asked yet
        self._replaced: dict[str, ShardEntry] = {}  # withdrawn, and a worker may have written over their files
        self._stored = time.monotonic()
        self._pause = MANIFEST_EVERY
        self._failed_now = 0
        self._sent: Counter[str] = Counter()

    def withdrawn(self, pieces: Iterator[Piece]) -> Iterator[Piece]:
        """The same pieces; the entry of a shard that is there already is out of the manifest before its piece is given.

        A worker writes over such a shard in place. Were it still listed when the run is killed, the file would not be
        what the manifest says. A file that is not listed is held against itself by the next run, and adopted or made
        anew.
        """
        while batch := list(islice(pieces, _AT_ONCE)):
            self._waiting = {one.file: self._entries.pop(one.file) for one in batch if one.file in self._entries}
            if self._waiting:
                self.store()
            for piece in batch:
                if piece.file in self._waiting:
                    self._replaced[piece.file] = self._waiting.pop(piece.file)
                yield piece

    def collect(
        self, client: Client, pieces: Iterator[Piece], *, quiet: bool = False, patience: float = PATIENCE
    ) -> None:
        """Have every piece simulated and recorded. However this ends, what has come back is recorded.

        Raises
        ------
        SimulationError
            If more systems fail than the budget allows, or the workers are gone.
        """
        flight = Dispatcher(
            client,
            simulate_shard,
            lambda task: (self.job, task.piece.file, tuple(task.piece.systems), task.deaths > 0),
            (_Task(piece) for piece in pieces),
            patience=patience,
        )
        began, finished = time.monotonic(), 0
        try:
            done = len(self.manifest.done())
            with progress_bar("simulating", self.manifest.systems, done=done, shown=not quiet) as bar:
                for task, outcome in flight:
                    if isinstance(outcome, KilledWorker):
                        self._killed(flight, task, outcome)
                    elif isinstance(outcome, BaseException):
                        raise outcome
                    elif outcome.lacks_package:
                        self._send_package(client, outcome.worker)
                        flight.again(task)
                    else:
                        self.take(task.piece, outcome)
                        finished += len(task.piece.systems)
                        rate = f"{finished / (time.monotonic() - began):.2f} systems/s"
                        bar.update(len(self.failures) + self._count(), note=rate)
                        self._check_budget(finished)
        finally:
            self._entries |= self._waiting
            self.store()
            if self._replaced:
                _log.warning(
                    "%s: shards that were being simulated again, out of the manifest until the next run: %d",
                    *(self.folder, len(self._replaced)),
                )

    def _send_package(self, client: Client, worker: str) -> None:
        self._sent[worker] += 1
        if self._sent[worker] > 2 * PER_WORKER:
            raise SimulationError(
                f"worker {worker} was sent the FMU and still lacks it; was a file of {self.system.path.parent} changed "
                "while the farm ran? Run again to go on"
            )
        client.run(receive, self.job.package, package_files(self.system), workers=[worker])

    def _killed(self, flight: Dispatcher[_Task], task: _Task, error: KilledWorker) -> None:
        """Nobody knows yet whose fault it was: simulate the shard under guard, which tells."""
        task.deaths += 1
        _log.debug("a worker died over shard %s", task.piece.file, extra=fields(worker=str(error.last_worker)))
        if task.deaths >= _DEATHS:
            raise SimulationError(
                f"{task.piece.file}: {task.deaths} workers died over it, the last at {error.last_worker.address}, "
                "though its FMU ran in a process apart; look for what ends them (memory, a queue's limits), run again"
            )
        flight.again(task)

    def take(self, piece: Piece, result: ShardResult) -> None:
        """Record one shard: first its failures, then its file, then its entry."""
        before = self._replaced.pop(piece.file, None)
        entry, failed = result.entry, result.failures
        if entry is None and before is not None and self._stands(before):
            # every system has failed this time and no file was written: what was there is kept
            entry, failed = before, [one for one in failed if one["system"] not in before.systems]
        new = self.failures.drop(piece.root_seed, piece.systems) > 0 or bool(failed)
        for failure in failed:
            self.failures.put(failure)
            _log.debug("system %d failed", failure["system"], extra=fields(**failure))
        self._failed_now += len(failed)
        if new:
            self.failures.write(self.folder)
        if entry is not None:
            if result.data is not None:
                write_atomically(self.folder / "shards" / piece.file, result.data)
            self._entries[piece.file] = entry
            _log.debug("shard %s", piece.file, extra=fields(systems=entry.systems, seed=piece.root_seed))
        if time.monotonic() - self._stored > self._pause:
            self.store()

    def _stands(self, entry: ShardEntry) -> bool:
        path = self.folder / "shards" / entry.file
        return path.exists() and sha256_of(path) == entry.sha256

    def store(self) -> None:
        """Write the manifest. The next time is the later, the longer this took."""
        began = time.monotonic()
        self.manifest.shards = [self._entries[file] for file in sorted(self._entries)]
        write_manifest(self.folder, self.manifest)
        self._stored = time.monotonic()
        self._pause = max(MANIFEST_EVERY, 20 * (self._stored - began))

    def _count(self) -> int:
        return sum(len(entry.systems) for entry in self._entries.values())

    def _check_budget(self, finished: int) -> None:
        failed, systems = len(self.failures), self.manifest.systems
        allowed = max(self.budget * systems, 1.0 if self.budget else 0.0)
        mostly = finished >= _EARLY and self._failed_now > finished / 2 and self.budget < 0.5
        if failed > allowed or mostly:
            last = list(self.failures)[-1]
            raise SimulationError(
                f"{self.folder}: {failed} systems failed, more than the failure budget of {self.budget:.0%} of "
                f"{systems} allows; see failures.jsonl. One cause: {last['cause']}"
            )
