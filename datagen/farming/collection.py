"""Taking shards in: records what comes back from the workers, judges what went wrong, and says how far it is."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from dask.distributed import Client, KilledWorker

from datagen.farming.dask_worker import worker_of
from datagen.farming.dispatch import PATIENCE, Dispatcher
from datagen.farming.failures import Failures
from datagen.farming.package import package_files, receive
from datagen.farming.plan import Piece
from datagen.farming.worker import Job, ShardResult, simulate_shard
from shared.errors import SimulationError
from shared.logs import fields, logger
from shared.progress import progress_bar
from shared.store import Manifest, ShardEntry, sha256_of, write_atomically, write_manifest
from shared.system import System

MANIFEST_EVERY = 5.0
"""Seconds between two writes of the manifest, at least; a shard between two of them is adopted by the next run."""
_DEATHS = 4
"""A shard under guard cannot take its worker down. If its workers still die so often, it is not the FMU."""
_ALONE = 2
"""Deaths under guard after which a shard is sent alone: before, it may only have waited beside one that crashed."""
_TRIES = 3
"""Times that a shard is tried where a worker cannot do it: one node may have a full disk, or older packages. Such a one
is idle at once, and would take it each time: the next try is another's, where there is one."""
_LACKS = 3
"""Times that a worker to which the FMU was sent may ask for it again."""
_EARLY = 20
"""Systems after which a run stops if more than half have failed, whatever the budget."""


_log = logger(__name__)


@dataclass(frozen=True)
class _Better:
    """A shard that was simulated again, beside the one that it will replace; ``failed`` are what it still lacks."""

    piece: Piece
    entry: ShardEntry
    failed: list[dict[str, Any]]


@dataclass
class _Task:
    piece: Piece
    guarded: bool = False
    deaths: int = 0
    """of workers while it was with them under guard"""
    refusals: int = 0
    """by workers that could not do it"""
    refused_by: set[str] = field(default_factory=set)
    """those of them that are known"""
    sent: float = 0.0
    """when it was given to Dask last [s]"""

    def arguments(self, job: Job, target: str) -> tuple[Any, ...]:
        """What :func:`simulate_shard` is called with, now."""
        self.sent = time.monotonic()
        return job, target, tuple(self.piece.systems), self.guarded


class Collection:
    """Collects the shards of one dataset.

    ``budget`` is the share of the systems that may fail. With ``retry`` systems that have failed before are tried
    again: then neither their failures of before nor that most of them fail again is a reason to stop.
    """

    replaces = False
    """Whether a shard that is simulated again has the content that its entry promises."""

    def __init__(
        self,
        folder: Path,
        manifest: Manifest,
        failures: Failures,
        job: Job,
        system: System,
        *,
        budget: float,
        retry: bool = False,
    ) -> None:
        self.folder = folder
        self.manifest = manifest
        self.failures = failures
        self.job = job
        self.system = system
        self.budget = budget
        self.retry = retry
        self._before = len(failures)
        self._entries = {entry.file: entry for entry in manifest.shards}
        self._better: dict[str, _Better] = {}  # to take their places when the manifest is written
        self._unwritten = False  # whether failures.jsonl is behind
        self._stored = time.monotonic()
        self._pause = MANIFEST_EVERY
        self._failed_now = 0
        self._sent: Counter[str] = Counter()
        self._delivered: dict[str, float] = {}  # to each worker, when [s]

    def target(self, piece: Piece) -> str:
        """File name for a worker to write a shard under.

        One that is there already is not written over: systems in it may fail this time. Its second version lies beside
        it, under a name that the next run clears away, until all of it is known.
        """
        return f".{piece.file}.again.tmp" if piece.file in self._entries else piece.file

    def collect(
        self, client: Client, pieces: Iterator[Piece], *, quiet: bool = False, patience: float = PATIENCE
    ) -> None:
        """Have every piece simulated and recorded. However this ends, what has come back is recorded.

        Raises SimulationError if more systems fail than the budget allows, or more than half of the first twenty or
        more do (not with a budget of a half or more, nor where failed ones are tried again), or the workers are gone.
        """
        flight = Dispatcher(
            client,
            simulate_shard,
            lambda task: task.arguments(self.job, self.target(task.piece)),
            (_Task(piece) for piece in pieces),
            patience=patience,
            avoided=lambda task: task.refused_by,
        )
        began, finished = time.monotonic(), 0
        try:
            done = len(self.manifest.done())
            with progress_bar("simulating", self.manifest.systems, done=done, shown=not quiet) as bar:
                for task, outcome in flight:
                    if isinstance(outcome, KilledWorker):
                        self._killed(flight, task, outcome)
                    elif isinstance(outcome, BaseException):
                        where = worker_of(outcome)
                        task.refusals += 1
                        task.refused_by |= {where} - {""}
                        if task.refusals >= _TRIES:
                            raise outcome
                        _log.warning("%s: worker %s: %s; tried again", task.piece.file, where or "unknown", outcome)
                        flight.again(task, alone=task.deaths >= _ALONE)
                    elif outcome.lacks_package:
                        if task.sent > self._delivered.get(outcome.worker, -1.0):
                            self._send_package(client, outcome.worker)
                        flight.again(task, alone=task.deaths >= _ALONE)
                    else:
                        self.take(task.piece, outcome)
                        finished += len(task.piece.systems)
                        rate = f"{finished / (time.monotonic() - began):.2f} systems/s"
                        bar.update(len(self.failures) + self._count(), note=rate)
                        self._check_budget(finished)
        finally:
            self.store()

    def _send_package(self, client: Client, worker: str) -> None:
        self._sent[worker] += 1
        if self._sent[worker] > _LACKS:
            raise SimulationError(
                f"worker {worker} was sent the FMU and still lacks it; was a file of {self.system.path.parent} changed "
                "while the farm ran? Run again to go on"
            )
        try:
            client.run(receive, self.job.package, package_files(self.system), workers=[worker])
        except OSError as error:
            if error.errno is not None:
                raise
            _log.debug("worker %s cannot be reached: %s", worker, error)  # it may be gone: others ask themselves
        self._delivered[worker] = time.monotonic()

    def _killed(self, flight: Dispatcher[_Task], task: _Task, error: KilledWorker) -> None:
        """Nobody knows yet whose fault it was: simulate the shard under guard, which tells.

        When a worker dies, Dask suspects all that was with it, also the shard that waited for the one at work.
        """
        _log.debug("a worker died over shard %s", task.piece.file, extra=fields(worker=str(error.last_worker)))
        task.deaths += task.guarded
        task.guarded = True
        if task.deaths >= _DEATHS:
            raise SimulationError(
                f"{task.piece.file}: {task.deaths} workers died over it, the last at {error.last_worker.address}, "
                "though its FMU ran in a process apart; look for what ends them (memory, a queue's limits, the"
                " scheduler's worker-ttl), run again"
            )
        flight.again(task, alone=task.deaths >= _ALONE)

    def take(self, piece: Piece, result: ShardResult) -> None:
        """Record one shard: first its failures, then its file, then its entry.

        One that was there before is replaced only by one that holds all its systems, and when the manifest is written.
        """
        before, entry = self._entries.get(piece.file), result.entry
        self._failed_now += len(result.failures)
        for failure in result.failures:
            _log.debug("system %d failed", failure["system"], extra=fields(**failure))
        if entry is not None:
            path = self.folder / "shards" / entry.file
            if result.data is not None:
                write_atomically(path, result.data)
            entry = entry.model_copy(update={"file": piece.file})
            _log.debug("shard %s", piece.file, extra=fields(systems=entry.systems, seed=piece.root_seed))
        if before is None:
            self._note(piece, piece.systems, result.failures)
            self._write_failures()
            if entry is not None:
                self._entries[piece.file] = entry
        elif (lost := set(before.systems).difference(entry.systems if entry else ())) and self._stands(before):
            _log.warning(
                "%s: kept as it was: simulated again, %d of its systems failed (%s)",
                *(self.folder / "shards" / piece.file, len(lost), min(lost)),
            )
            self._note(piece, (), [one for one in result.failures if one["system"] not in before.systems])
            self._write_failures()
            if entry is not None:
                path.unlink(missing_ok=True)
        elif entry is not None:
            self._better[piece.file] = _Better(piece, entry, result.failures)
        else:  # what was there is damaged, and nothing came in its place
            self._note(piece, piece.systems, result.failures)
            self._write_failures()
            del self._entries[piece.file]
        if time.monotonic() - self._stored > self._pause:
            self.store()

    def _note(self, piece: Piece, known: Iterable[int], failed: list[dict[str, Any]]) -> None:
        """The failures of some systems of a shard are forgotten, those that ``failed`` are put in."""
        self._unwritten |= self.failures.drop(piece.root_seed, known) > 0 or bool(failed)
        for failure in failed:
            self.failures.put(failure)

    def _write_failures(self) -> None:
        if self._unwritten:
            self.failures.write(self.folder)
            self._unwritten = False

    def _stands(self, entry: ShardEntry) -> bool:
        path = self.folder / "shards" / entry.file
        return path.exists() and sha256_of(path) == entry.sha256

    def store(self) -> None:
        """Write the manifest. The next time is the later, the longer this took.

        Shards that were simulated again take their places now, and are out of the manifest while they do: were one
        listed when the run is killed, the file would not be what the manifest says. A file that is not listed is held
        against itself by the next run, and adopted, with the systems that had failed before. Where ``replaces`` they
        stay listed: nobody adopts a shard of a merged dataset, and one that is not what its entry says is mended again.
        """
        began = time.monotonic()
        if self._better:
            if not self.replaces:
                self._write([entry for file, entry in self._entries.items() if file not in self._better])
            for file in list(self._better):
                os.replace(
                    self.folder / "shards" / self.target(self._better[file].piece), self.folder / "shards" / file
                )
                one = self._better.pop(file)
                self._entries[file] = one.entry
                self._note(one.piece, one.piece.systems, one.failed)
        self._write_failures()
        self._write(list(self._entries.values()))
        self._stored = time.monotonic()
        self._pause = max(MANIFEST_EVERY, 20 * (self._stored - began))

    def _write(self, entries: list[ShardEntry]) -> None:
        # of a merged dataset the order is that of its parts, and systems of equal index follow it
        self.manifest.shards = entries if self.manifest.sources else sorted(entries, key=lambda one: one.file)
        write_manifest(self.folder, self.manifest)

    def _count(self) -> int:
        return sum(len(entry.systems) for entry in self._entries.values())

    def _check_budget(self, finished: int) -> None:
        systems = self.manifest.systems
        allowed = max(self.budget * systems, 1.0 if self.budget else 0.0, self._before if self.retry else 0.0)
        if self._better and len(self.failures) > allowed:
            self.store()  # some of them did not fail again
        failed = len(self.failures)
        early = not self.retry and self.budget < 0.5
        mostly = early and finished >= _EARLY and self._failed_now > finished / 2
        if failed <= allowed and not mostly:
            return
        if failed > allowed:
            some = f"{failed} {'system' if failed == 1 else 'systems'}"
            found = f"{some} failed, more than the failure budget of {self.budget:.0%} of {systems} allows"
        else:
            found = (
                f"{self._failed_now} of the {finished} systems that this run has tried failed; expected at most half to"
            )
        raise SimulationError(
            f"{self.folder}: {found}; see failures.jsonl. One cause: {list(self.failures)[-1]['cause']}"
        )
