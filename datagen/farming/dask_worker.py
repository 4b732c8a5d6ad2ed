"""The Dask worker that this process is, if it is one: its address, its folder, and when a fresh process takes over."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from distributed import get_worker

from datagen.fmi.fmu import SCRATCH

RECYCLE = 512 * 2**20
"""Bytes that a worker may grow by after its first shard before it is replaced by a fresh one."""
FETCHED = 0.5
"""Seconds in which the client has fetched a shard's result, after which its worker may go."""
HELD_BACK = 5.0
"""Seconds for which a worker that is about to go begins nothing: short shards could make it grow much further yet."""
_NOTE = "on worker "
_BASE: list[int] = []
_LEAVING: list[bool] = []


def this_worker() -> Any:
    """The worker; None where this process is none."""
    try:
        return get_worker()
    except ValueError:
        return None


def address() -> str:
    """Of this worker; empty where there is none."""
    worker = this_worker()
    return worker.address if worker is not None else ""


@contextmanager
def named() -> Iterator[None]:
    """Note in an exception which worker it comes from: the client does not learn it otherwise."""
    try:
        yield
    except Exception as error:
        if where := address():
            error.add_note(_NOTE + where)
        raise


def worker_of(error: BaseException) -> str:
    """Address of the worker that an exception comes from; empty where that is not known."""
    notes = [note.removeprefix(_NOTE) for note in getattr(error, "__notes__", ()) if note.startswith(_NOTE)]
    return notes[-1] if notes else ""


def unpack_in_scratch() -> None:
    """Have FMUs unpacked where this worker's nanny clears up, even when the worker was killed."""
    worker = this_worker()
    if worker is not None and worker.nanny is not None:
        os.environ[SCRATCH] = worker.local_directory


def recycle(growth: float, rss: int) -> None:
    """Replace this worker process by a fresh one when it has grown too much: some FMUs leak.

    ``growth`` is how much is too much, since its first shard [bytes]; ``rss`` its memory now [bytes].
    """
    worker = this_worker()
    if not _BASE:
        _BASE.append(rss)
    if worker is None or worker.nanny is None or _LEAVING or rss < _BASE[0] + growth:
        return
    _LEAVING.append(True)
    worker.loop.add_callback(_leave, worker)


def _leave(worker: Any) -> None:
    """On the worker's loop: have it go a little later, so that the client has fetched this shard by then.

    A heartbeat that the scheduler gets when it has let the worker go would make it close its nanny as well, for good.
    """
    worker.periodic_callbacks["heartbeat"].stop()
    worker.loop.call_later(FETCHED, worker.close_gracefully, restart=True)


def hold_back() -> None:
    """Wait where this worker is about to go: what it is given meanwhile is done by the one that takes its place."""
    if _LEAVING:
        time.sleep(HELD_BACK)
