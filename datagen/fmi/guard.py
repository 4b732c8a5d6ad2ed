"""Systems under guard: each simulated in a child process, so that an FMU which crashes or hangs takes only that down.

The farm uses it for shards whose worker died, and for the first look at an FMU. It costs a few seconds for the start
of the child, so it is not how systems are simulated normally. The child leaves one file per finished item; the parent
watches its exit code, its clock and its memory, and starts another child for the items that are left.
"""

from __future__ import annotations

import errno
import faulthandler
import math
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import psutil

from datagen.fmi.fmu import SCRATCH
from shared import watchdog
from shared.children import command, environment
from shared.errors import SimulationError, ZeroshotError
from shared.places import OF_A_DISK, no_temporary_place

START_UP = 120.0
"""Seconds that a child may take until its first item begins."""
_POLL = 0.05
NO_PLACE = 73
"""Exit code of a child that could not write what it found: EX_CANTCREAT of sysexits.h."""


def guarded(
    function: Callable[[Any], Any],
    items: Sequence[Any],
    *,
    timeout: float,
    limit: float = math.inf,
    memory_limit: float = math.inf,
    tries: int = 2,
) -> list[Any]:
    """``[function(item) for item in items]`` in child processes; what cannot be had is an exception in its place.

    ``function`` is importable by name; a ``ZeroshotError`` that it raises is kept as the item's result. One item may
    take ``timeout`` [s], one simulation of it ``limit`` [s], and a child ``memory_limit`` [bytes]. An item that has
    taken its child down so many ``tries`` is given up; the later ones are alone in their child. Raises SimulationError
    if a child cannot start, or the temporary folder cannot be written to.
    """
    try:
        return _guarded(function, items, (timeout, limit), memory_limit, tries)
    except OSError as error:
        cause = no_temporary_place(error) if error.errno in OF_A_DISK else error.strerror or str(error)
        raise SimulationError(f"a child process could not do its work: {cause}") from None


def _guarded(
    function: Callable[[Any], Any], items: Sequence[Any], limits: tuple[float, float], memory_limit: float, tries: int
) -> list[Any]:
    results: dict[int, Any] = {}
    deaths = dict.fromkeys(range(len(items)), 0)
    with tempfile.TemporaryDirectory(prefix="zeroshot-guard-") as name:
        folder = Path(name)
        while len(results) < len(items):
            left = [k for k in range(len(items)) if k not in results]
            suspects = [k for k in left if deaths[k]]
            group = suspects[:1] or left
            guilty, cause = _one_child(function, [(k, items[k]) for k in group], folder, limits, memory_limit)
            for path in sorted(folder.glob("*.result")):
                results[int(path.stem)] = pickle.loads(path.read_bytes())
                path.unlink()
            if guilty is not None and guilty not in results:
                deaths[guilty] += 1
                if deaths[guilty] >= tries:
                    results[guilty] = SimulationError(cause)
    return [results[k] for k in range(len(items))]


def _one_child(
    function: Callable[[Any], Any],
    work: list[tuple[int, Any]],
    folder: Path,
    limits: tuple[float, float],
    memory_limit: float,
) -> tuple[int | None, str]:
    """Run a child over some items; returns the item that took it down, if one did, and how."""
    current = folder / "current"
    current.unlink(missing_ok=True)
    timeout, limit = limits
    (folder / "work").write_bytes(pickle.dumps((function, work, timeout, limit)))
    # a session of its own: Ctrl-C at the terminal is for the farm, which then ends the child
    child = subprocess.Popen(
        command("datagen.fmi.guard", str(folder), str(os.getpid())),
        env={**environment(), SCRATCH: str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    cause = ""
    at = -1
    since = time.monotonic()
    try:
        while child.poll() is None:
            time.sleep(_POLL)
            now = _read_current(current)
            if now != at:
                at, since = now, time.monotonic()
            if time.monotonic() - since > (timeout if at >= 0 else START_UP):
                cause = f"did not end within {timeout:g} s"
                break
            try:
                used = psutil.Process(child.pid).memory_info().rss
            except psutil.Error:
                continue
            if used > memory_limit:
                cause = f"used more than {memory_limit / 2**20:.0f} MiB of memory"
                break
    finally:
        if child.poll() is None:
            child.kill()
        child.wait()
    if not cause and child.returncode == 0:
        return None, ""
    if child.returncode == NO_PLACE:
        raise OSError(errno.ENOSPC, "a child process had no room for its results", str(folder))
    at = _read_current(current)
    if at < 0:
        raise SimulationError(f"a child process could not start (exit code {child.returncode})")
    if child.returncode == watchdog.HUNG:
        cause = f"one of the FMU's functions had not returned after {limit:g} s"
    return at, cause or f"the FMU took its process down ({_ending(child.returncode)})"


def _read_current(path: Path) -> int:
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        return -1


def _ending(code: int) -> str:
    if code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    return f"exit code {code}"


def _child(folder: Path, parent: int) -> None:
    function, work, timeout, limit = pickle.loads((folder / "work").read_bytes())
    watchdog.serve(limit)
    for number, item in work:
        if os.name == "posix" and os.getppid() != parent:
            return  # whoever waited for us is gone
        (folder / "current.part").write_text(str(number))
        os.replace(folder / "current.part", folder / "current")
        faulthandler.dump_traceback_later(2 * timeout, exit=True)  # should the parent be killed while this hangs
        try:
            result = function(item)
        except ZeroshotError as error:
            result = error
        faulthandler.cancel_dump_traceback_later()
        (folder / f"{number}.part").write_bytes(pickle.dumps(result))
        os.replace(folder / f"{number}.part", folder / f"{number}.result")


if __name__ == "__main__":
    try:
        _child(Path(sys.argv[1]), int(sys.argv[2]))
    except OSError:
        sys.exit(NO_PLACE)
