"""The Dask worker that this process is, if it is one: its address, its folder, and when a fresh process takes over."""

from __future__ import annotations

import os
from typing import Any

from distributed import get_worker

from datagen.fmi.fmu import SCRATCH

RECYCLE = 512 * 2**20
"""Bytes that a worker may grow by after its first shard before it is replaced by a fresh one."""
_BASE: list[int] = []


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
    if worker is None or worker.nanny is None or rss < _BASE[0] + growth:
        return
    # a little later, so that the client has fetched this shard by then
    worker.loop.add_callback(worker.loop.call_later, 0.5, worker.close_gracefully, restart=True)
