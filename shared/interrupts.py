"""Ctrl-C and SIGTERM: one process answers to them, in order, and the processes that work for it are left in peace.

A terminal sends Ctrl-C to every process of a command at once. A worker that dies of it would be taken for one that
failed at its work.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any


class Terminated(KeyboardInterrupt):
    """SIGTERM, by which a queue or a container ends its processes: as good a reason as Ctrl-C to stop in order."""


AGAIN = 0.05
"""A signal whose exception was swallowed is sent anew after so long [s]."""


@contextmanager
def terminable() -> Iterator[None]:
    """Take SIGTERM for Ctrl-C while this lasts: it raises :class:`Terminated`.

    Where either is raised within a destructor, Python drops the exception, and the program would go on as if nobody had
    wanted to stop it. So it is raised again, a moment later.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may set a handler, and only it is interrupted
        return
    process = os.getpid()

    def stop(number: int, _frame: Any) -> None:
        if os.getpid() != process:  # a child that inherited this handler is to end as it would without
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)
        raise Terminated

    dropped = sys.unraisablehook

    def again(found: Any) -> None:
        if not isinstance(found.exc_value, KeyboardInterrupt):
            dropped(found)
            return
        number = signal.SIGTERM if isinstance(found.exc_value, Terminated) else signal.SIGINT
        later = threading.Timer(AGAIN, _interrupt, [number])  # at once, it would be dropped here, too
        later.daemon = True
        later.start()

    before = signal.signal(signal.SIGTERM, stop)
    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = dropped
        signal.signal(signal.SIGTERM, before)


def _interrupt(number: int) -> None:
    """Send a signal to the main thread of this process, which may be waiting."""
    if sys.platform == "win32":
        signal.raise_signal(number)
        return
    main = threading.main_thread().ident
    assert main is not None
    signal.pthread_kill(main, number)


@contextmanager
def interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back while workers start: they inherit that for good, and only this process answers to it."""
    if sys.platform == "win32":
        yield
        return
    resource_tracker.ensure_running()  # its start would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
