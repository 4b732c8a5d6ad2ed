"""Children of :mod:`shared.netcdf`, forked off a process that has imported what they need.

Each is a process of its own as before, with limits, an end and a standard error of its own; what it saves is to start
an interpreter and to import NumPy and netCDF4 for each file, which takes thirty times as long as to read most.

python -P tests/forked.py shared.netcdf_child

is the mother: her standard input is a socket, over which each request is the child's words and two files to write to.
"""

from __future__ import annotations

import os
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from pathlib import Path
from typing import Any

from shared.children import command, environment

_MODULE = "shared.netcdf_child"
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
_LONGEST = 4096
"""Bytes of a request: it arrives in one piece."""
_NUMBER = 12
"""Bytes of an answer."""


class Forked:
    """Stands for the module ``subprocess``: ``run`` forks what is this child exactly, and starts all else."""

    def __init__(self) -> None:
        ours, hers = socket.socketpair()
        words = [sys.executable, "-P", str(Path(__file__).resolve()), _MODULE]
        quiet: dict[str, Any] = {"stdin": hers, "stdout": subprocess.DEVNULL, "start_new_session": True}
        self._mother = subprocess.Popen(words, env=environment() | _ONE_THREAD, **quiet)
        hers.close()
        self._line, self._lock, self._pid = ours, threading.Lock(), os.getpid()

    def __getattr__(self, name: str) -> Any:
        return getattr(subprocess, name)

    def close(self) -> None:
        """End the mother."""
        self._line.close()
        self._mother.wait(30)

    def run(self, words: list[str], **how: Any) -> subprocess.CompletedProcess[bytes]:
        """As :func:`subprocess.run`."""
        alone = {"stdin": subprocess.DEVNULL, "capture_output": True, "env": environment() | _ONE_THREAD}
        same = words[:-3] == command(_MODULE) and how == alone | {"timeout": how.get("timeout")}
        request = b"\0".join(map(os.fsencode, words[-3:]))
        if not same or request.count(b"\0") != 2 or len(request) > _LONGEST or os.getpid() != self._pid:
            return subprocess.run(words, **how)
        with self._lock:
            code, out, said = self._ask(request, words, how["timeout"])
        return subprocess.CompletedProcess(words, code, out, said)

    def _ask(self, request: bytes, words: list[str], timeout: float) -> tuple[int, bytes, bytes]:
        until = time.monotonic() + timeout
        out, said = os.pipe(), os.pipe()
        socket.send_fds(self._line, [request], [out[1], said[1]])
        for one in (out[1], said[1]):
            os.close(one)
        pid, found = self._answer(), {out[0]: bytearray(), said[0]: bytearray()}
        try:
            with selectors.DefaultSelector() as waiting:
                for one in found:
                    waiting.register(one, selectors.EVENT_READ)
                while waiting.get_map():
                    ready = waiting.select(until - time.monotonic())
                    if not ready:
                        os.kill(pid, signal.SIGKILL)
                        raise subprocess.TimeoutExpired(words, timeout)
                    for key, _ in ready:
                        some = os.read(key.fd, 1 << 20)
                        found[key.fd] += some
                        if not some:
                            waiting.unregister(key.fd)
        finally:
            for one in found:
                os.close(one)
            code = self._answer()
        return code, bytes(found[out[0]]), bytes(found[said[0]])

    def _answer(self) -> int:
        answer = self._line.recv(_NUMBER)
        if not answer:
            raise RuntimeError("the process is gone that forks the readers of NetCDF files")
        return int(answer)


def _mother() -> None:
    """Fork a child for each request until nobody can ask any more: answers its process id, then how it ended."""
    from shared import netcdf_child

    line = socket.socket(fileno=os.dup(0))
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    assert threading.active_count() == 1  # a thread would hold its locks for ever in the child
    while True:
        request, files, *_ = socket.recv_fds(line, _LONGEST, 2)
        if not request:
            return
        pid = os.fork()
        if pid == 0:
            _child(netcdf_child.main, list(map(os.fsdecode, request.split(b"\0"))), files, line)
        for one in files:
            os.close(one)
        line.sendall(str(pid).rjust(_NUMBER).encode())
        line.sendall(str(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])).rjust(_NUMBER).encode())


def _child(main: Any, words: list[str], files: list[int], line: socket.socket) -> None:
    code = 1
    try:
        line.close()
        for one, place in zip(files, (1, 2), strict=True):
            os.dup2(one, place)
            os.close(one)
        code = main(words)
        sys.stdout.flush()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    _mother()
