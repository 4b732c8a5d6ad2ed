"""A wall-clock limit for compiled code, in which no Python runs that could look at a clock."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from datagen.fmi import calls


@contextmanager
def watchdog(plan: np.ndarray, timeout: float | None) -> Iterator[None]:
    """Set the plan's mark after ``timeout`` [s]; the compiled code runs without the interpreter's lock and sees it."""
    if timeout is None:
        yield
        return
    timer = threading.Timer(timeout, plan.__setitem__, (calls.EXPIRED, 1))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
