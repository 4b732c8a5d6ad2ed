"""Means to hurt the farm: a farm in a process of its own, found by its processes, killed where it hurts."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil

from shared.store import read_manifest

ROOT = Path(__file__).resolve().parents[2]
_spec = importlib.util.spec_from_file_location("faulty", ROOT / "tests" / "fmus" / "faulty" / "__init__.py")
assert _spec is not None and _spec.loader is not None
faulty = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(faulty)


def farm(*words, **kinds):
    """Start ``datagen run`` as a user would, in a process group of its own."""
    command = [sys.executable, "-m", "datagen.cli", "run", *map(str, words)]
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


def finish(process, timeout=90):
    """Exit code and output of a process."""
    said, _ = process.communicate(timeout=timeout)
    return process.returncode, said


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
