"""Child processes of this package's own modules: what may crash or never end is not done in this process.

A child finds modules where its parent does, and nowhere else: ``python -m`` by itself would look into the current
folder first, which may be one that came from elsewhere.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

from shared import watchdog
from shared.errors import SimulationError
from shared.interrupts import interrupts_held


def command(module: str, *arguments: str) -> list[str]:
    """A command line that runs a module with this interpreter."""
    return [sys.executable, "-P", "-m", module, *arguments]


def environment(base: Mapping[str, str] | None = None) -> dict[str, str]:
    """Environment of a child: ``base``, or that of this process, with the places where this process finds modules."""
    places = os.pathsep.join(place or os.getcwd() for place in sys.path)
    return {**(os.environ if base is None else base), "PYTHONPATH": places}


@contextmanager
def without_script() -> Iterator[None]:
    """Let processes that :mod:`multiprocessing` starts meanwhile not run the script of this one, as it would have them.

    They need nothing of it, and where it has no ``if __name__ == "__main__":`` each would begin its work anew.
    """
    main = sys.modules["__main__"]
    spec, file = main.__spec__, main.__dict__.pop("__file__", None)
    main.__spec__ = None
    try:
        yield
    finally:
        main.__spec__ = main.__spec__ or spec
        if file is not None:
            main.__file__ = file


@contextmanager
def starting() -> Iterator[None]:
    """For the moment in which :mod:`multiprocessing` starts workers: without the script, and deaf to Ctrl-C."""
    with without_script(), interrupts_held():
        yield


@contextmanager
def worker_pool(
    workers: int, initialise: Callable[..., None] | None = None, arguments: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Processes side by side, spawned: loading an FMU changes the folder of its process.

    They have the limit for each simulation that this process has. Where the body ends by an exception they are killed,
    whatever they do: one whose FMU never returns would be waited for in vain. Raises SimulationError in place of what
    the body raised, if a worker's FMU did not return within the limit.
    """
    with tempfile.TemporaryDirectory(prefix="zeroshot-workers-", ignore_cleanup_errors=True) as folder:
        seconds = watchdog.limit()
        pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin, (seconds, folder, initialise, arguments))
        try:
            yield pool
            pool.shutdown()
        except BaseException as error:
            processes = list((pool._processes or {}).values())
            for one in processes:
                one.kill()
            pool.shutdown(cancel_futures=True)  # after which the exit codes are known
            if isinstance(error, Exception) and any(one.exitcode == watchdog.HUNG for one in processes):
                raise SimulationError(
                    f"an FMU's function had not returned after {seconds:g} s in one of {workers} processes; expected"
                    " one that returns: give it longer with --timeout, or look at its inputs and parameters"
                ) from None
            raise


def _begin(seconds: float, folder: str, initialise: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    tempfile.tempdir = folder  # what a worker that was killed left there is removed
    watchdog.serve(seconds)
    if initialise is not None:
        initialise(*arguments)
