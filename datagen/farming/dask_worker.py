"""The Dask worker that this process is, if it is one: its address, its folder, and when a fresh process takes over."""

from __future__ import annotations

import os
import signal
import time
from typing import Any

from distributed import get_worker

from datagen.fmi.fmu import SCRATCH

RECYCLE = 512 * 2**20
"""Bytes that a worker may grow by after its first shard before it is replaced by a fresh one."""
LEAVE_WITHIN = 90
"""Seconds that a worker has for going: to hand over its results, to finish the shard at work (Dask waits for 30 s), to
clear up."""
FETCHED = 0.5
"""Seconds in which the client has fetched a shard's result, after which its worker may go."""
HELD_BACK = 5.0
"""Seconds for which a worker that is about to go begins nothing: short shards could make it grow much further yet."""
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


def unpack_in_scratch() -> None:
    """Have FMUs unpacked where this worker's nanny clears up, even when the worker was killed."""
    worker = this_worker()
    if worker is not None and worker.nanny is not None:
        os.environ[SCRATCH] = worker.local_directory


def recycle(growth: float, rss: int) -> None:
    """Replace this worker process by a fresh one when it has grown too much: some FMUs leak.

    Parameters
    ----------
    growth
        How much is too much, since its first shard [bytes].
    rss
        Its memory now [bytes].
    """
    worker = this_worker()
    if not _BASE:
        _BASE.append(rss)
    if worker is None or worker.nanny is None or _LEAVING or rss < _BASE[0] + growth:
        return
    _LEAVING.append(True)
    end_within(LEAVE_WITHIN)
    # a little later, so that the client has fetched this shard by then
    worker.loop.add_callback(worker.loop.call_later, FETCHED, worker.close_gracefully, restart=True)


def hold_back() -> None:
    """Wait where this worker is about to go: what it is given meanwhile is done by the one that takes its place."""
    if _LEAVING:
        time.sleep(HELD_BACK)


def end_within(seconds: int) -> None:
    """Have the system end this process after a time, whatever it hangs in: its nanny starts a fresh one then.

    A process that is done with Python may hang in what a library does at its end, with the interpreter's lock held;
    its nanny waits for it and starts no other. An alarm needs neither lock nor thread. Windows has none: a process
    that hangs there has to be ended by hand.

    Parameters
    ----------
    seconds
        The time [s], from 1.
    """
    if hasattr(signal, "alarm"):
        signal.alarm(seconds)
