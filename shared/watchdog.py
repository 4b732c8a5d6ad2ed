"""A watchdog over compiled code of others, such as an FMU's: a signal or a time limit ends what never returns.

Python answers a signal, or looks at a clock, between two of its own instructions. Code that loops for ever comes back
to none, so a thread looks after it. It first asks the code to stop, as the loops around an FMU do. What has not
returned :data:`GRACE` later ends with its process, with a sentence: commands and their workers allow that. In a program
of one's own only the asking takes place.
"""

from __future__ import annotations

import atexit
import math
import multiprocessing
import os
import select
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Annotated, Any, NoReturn

from cyclopts import Parameter

from shared.errors import ZeroshotError

USUAL = 600.0
"""Seconds that a command gives one simulation."""
GRACE = 1.0
"""Seconds from the wish to stop to the end of the process: a loop that looks whether to stop does so in far less."""
HUNG = 124
"""Exit code of a worker whose FMU did not return, as that of the program ``timeout``."""
_LOOK = 0.05
"""Seconds between two looks at the clock."""
_SHORTEST, _LONGEST = 0.001, 1e9
"""Of a time limit [s]: faulthandler watches over it in microseconds, and over twice as long in a child process."""
Ending = Callable[[str, int | None, float], NoReturn]
"""Ends the process, given whose code did not return, the signal that came, if one did, and the limit [s]."""


@Parameter(name="*")
@dataclass(frozen=True)
class Patience:
    """How long one simulation may take; every command that simulates has this option."""

    timeout: Annotated[
        float,
        Parameter(
            help="Seconds that one simulation may take before it is given up. An FMU that does not even return from one"
            " of its functions ends the command."
        ),
    ] = USUAL


PATIENT = Patience()
"""The usual limit."""


@dataclass(eq=False)
class _Call:
    """Code that is being run: of whom, its limit [s], how it is asked to stop, and since when it has been asked."""

    what: str
    limit: float
    ask: Callable[[], None]
    began: float
    asked: float = math.inf
    number: int | None = None


_calls: list[_Call] = []
_cleaning: list[Callable[[], object]] = []
_limit = math.inf
_ending: Ending | None = None
_signals: socket.socket | None = None
_looking: tuple[int, threading.Thread] | None = None


def check_timeout(timeout: float) -> None:
    """Refuse a time for one simulation [s] that no watch can keep, or that is no number: a ZeroshotError."""
    if not _SHORTEST <= timeout <= _LONGEST:  # of a NaN no comparison holds
        raise ZeroshotError(f"timeout is {timeout:g} s; expected {_SHORTEST:g} to {_LONGEST:g} s")


def limit() -> float:
    """Seconds that one simulation may take in this process, infinity where nothing limits it."""
    return _limit


@contextmanager
def watched(what: str, ask: Callable[[], None] = lambda: None, timeout: float | None = None) -> Iterator[None]:
    """Look after code of others, ``what`` in the sentence, while this lasts.

    ``ask`` asks it to stop, from another thread. Its ``timeout`` is a limit [s]; that of the process, if not given.
    """
    call = _Call(what, _limit if timeout is None else timeout, ask, time.monotonic())
    if _ending is not None or call.limit < math.inf:
        _look()
    _calls.append(call)
    try:
        yield
    finally:
        _calls.remove(call)


@contextmanager
def armed(ending: Ending, seconds: float = USUAL) -> Iterator[None]:
    """Allow the end of this process, with a limit for each simulation [s], while this lasts.

    In the main thread signals are watched, too. Raises ZeroshotError if the limit is none.
    """
    global _limit, _ending, _signals
    check_timeout(seconds)
    before = _limit, _ending, _signals
    _limit, _ending = seconds, ending
    if threading.current_thread() is not threading.main_thread():
        try:
            yield
        finally:
            _limit, _ending, _signals = before
        return
    _signals, sender = socket.socketpair()
    sender.setblocking(False)
    descriptor = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(descriptor)
        mine = _signals
        _limit, _ending, _signals = before
        sender.close()
        mine.close()


def serve(seconds: float) -> None:
    """Allow the end of this worker process, for good, by :data:`HUNG`; with a limit for each simulation [s]."""
    global _limit, _ending
    _limit, _ending = seconds, lambda *_: leave(HUNG)


def clean_at_end(function: Callable[..., object], *arguments: Any) -> None:
    """Call a function when this process ends, be it by :func:`leave`."""
    atexit.register(function, *arguments)
    _cleaning.append(lambda: function(*arguments))


def leave(code: int) -> NoReturn:
    """End this process and its workers at once, though its main thread never returns."""
    for child in multiprocessing.active_children():
        child.kill()
    for clean in _cleaning:
        with suppress(Exception):  # nobody is left to be told
            clean()
    os._exit(code)


def _look() -> None:
    """Have the thread that looks, in this very process: a child that was forked off has none."""
    global _looking
    if _looking is None or _looking[0] != os.getpid():
        thread = threading.Thread(target=_look_on, name="watchdog", daemon=True)
        _looking = os.getpid(), thread
        thread.start()


def _look_on() -> None:
    while True:
        number = _signal()
        now = time.monotonic()
        for call in tuple(_calls):
            if call.asked == math.inf and (number is not None or now - call.began > call.limit):
                call.asked, call.number = now, number
                call.ask()
            if now - call.asked > GRACE and _ending is not None and call in _calls:
                _ending(call.what, call.number, call.limit)


def _signal() -> int | None:
    """The number of a signal to stop that came within the next :data:`_LOOK` seconds, if one did."""
    heard = _signals
    if heard is None:
        time.sleep(_LOOK)
        return None
    try:
        if not select.select([heard], [], [], _LOOK)[0]:
            return None
        stops = [one for one in heard.recv(4096) if one in (signal.SIGINT, signal.SIGTERM)]
    except (OSError, ValueError):  # closed meanwhile
        time.sleep(_LOOK)
        return None
    return stops[-1] if stops else None
