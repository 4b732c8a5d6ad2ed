"""Means to hurt the farm: a farm in a process of its own, found by its processes, killed where it hurts."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext, suppress
from pathlib import Path

import psutil
import pytest

from datagen import run
from datagen.farming import worker
from shared.errors import SimulationError
from shared.store import read_manifest

ROOT = Path(__file__).resolve().parents[2]
_spec = importlib.util.spec_from_file_location("faulty", ROOT / "tests" / "fmus" / "faulty" / "__init__.py")
assert _spec is not None and _spec.loader is not None
faulty = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(faulty)


_RUN = """
import datagen.simulating.liveness
from datagen.cli import main
datagen.simulating.liveness.check_live_apart = lambda *_: None
main()
"""


def farm(*words, **kinds):
    """Start ``datagen run`` as a user would, in a process group of its own; the FMU is not tried before."""
    command = [sys.executable, "-c", _RUN, "run", *map(str, words)]
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        # a shell that starts the tests in the background has told them, and so their children, to ignore Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **kinds,
    )


def finish(process, timeout=300):
    """Exit code and output of a process; one that does not end is ended, with its group."""
    try:
        said, _ = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise
    return process.returncode, said


def family_of(pid):
    """All processes below a process, and itself."""
    try:
        process = psutil.Process(pid)
        return [process, *process.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def alive(processes):
    """Those that still run; a dead one that nobody has collected does not."""
    return [one for one in processes if one.is_running() and _status(one) != psutil.STATUS_ZOMBIE]


def _status(process):
    try:
        return process.status()
    except psutil.NoSuchProcess:
        return psutil.STATUS_ZOMBIE


def workers_of(pid):
    """Worker processes below a process."""
    try:
        below = psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []
    return [one.pid for one in below if _is_worker(one)]


def _is_worker(process):
    try:
        return "spawn_main" in " ".join(process.cmdline())
    except psutil.Error:
        return False


def wait_for(condition, timeout=180):
    """Wait until something is true; returns it."""
    until = time.monotonic() + timeout
    while time.monotonic() < until:
        found = condition()
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError("waited in vain")


def shards_in(folder):
    """Shard files that are in a dataset's folder."""
    return sorted((Path(folder) / "shards").glob("*.nc"))


def kill(pid):
    os.kill(pid, signal.SIGKILL)


def hashes(folder):
    """Content hashes by file."""
    return {entry.file: entry.content_hash for entry in read_manifest(folder).shards}


class InThisProcess:
    """A dispatcher without workers."""

    def __init__(self, client, function, arguments, source, **_):
        self.work = ((task, function, arguments) for task in source)

    def __iter__(self):
        return ((task, function(*arguments(task))) for task, function, arguments in self.work)


def failing(monkeypatch, *systems):
    """Let these systems fail from now on, and no others."""
    real = failing.real

    def attempt(work):
        if work[1] in systems:
            raise SimulationError(f"system {work[1]} does not want to")
        return real(work)

    monkeypatch.setattr(worker, "attempt", attempt)


failing.real = worker.attempt


def stay_in_this_process(monkeypatch):
    """Let runs and repairs simulate here, one system after another, and try no FMU beforehand."""
    for module in ("datagen.farming.farm", "datagen.datasets.mending"):
        monkeypatch.setattr(f"{module}.connect", lambda **_: nullcontext())
    monkeypatch.setattr("datagen.farming.farm.check_live_apart", lambda *_: None)
    monkeypatch.setattr("datagen.farming.collection.Dispatcher", InThisProcess)


def run_here(*words, **settings):
    """A run that simulates in this process."""
    with pytest.MonkeyPatch.context() as patch:
        stay_in_this_process(patch)
        return run(*words, quiet=True, **settings)


class Killed(BaseException):
    """In place of ``kill -9``."""


def killed_at_write(last, work, *words, **settings):
    """Do some work, killed before the write after the ``last`` one; returns how many writes there were."""
    real, count = os.replace, 0

    def replace(*names):
        nonlocal count
        if count >= last:
            raise Killed
        count += 1
        real(*names)

    with pytest.MonkeyPatch.context() as patch, suppress(Killed):
        patch.setattr(os, "replace", replace)
        work(*words, **settings)
    return count
