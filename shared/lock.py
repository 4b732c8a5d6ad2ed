"""One process at a time on a folder: a dataset, a training, a search.

The operating system holds the lock, so it is free again however the run ended, ``kill -9`` included. The file also
says who holds it, and its ``token`` lets a worker find out whether it sees this very folder.
"""

from __future__ import annotations

import errno
import json
import os
import socket
import sys
import time
import uuid
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from shared.errors import DatasetError, ZeroshotError
from shared.logs import logger
from shared.reading import read_json

FILE_NAME = ".lock"
_FAR = 1 << 30
"""Offset of the locked byte: on Windows a locked byte cannot be read, and the text in front must be."""
_TAKEN = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
_CANNOT_LOCK = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
"""Of file systems without locks: NFS, Lustre, FUSE each have their own word."""
_log = logger(__name__)


def _take(handle: IO[str]) -> None:
    if sys.platform == "win32":
        import msvcrt

        handle.seek(_FAR)
        msvcrt.locking(handle.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(handle.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)


def _look(handle: IO[str]) -> None:
    """As :func:`_take`, for one that only looks: others may at the same time, and the lock goes with the handle."""
    if sys.platform == "win32":  # which knows no shared lock of a byte
        _take(handle)
    else:
        import fcntl

        fcntl.flock(handle.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)


def _exists(pid: int) -> bool:
    if not 0 < pid < 1 << 31:
        return False
    if sys.platform == "win32":  # where such a signal would end the process; its own locks always work
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # another user's
        pass
    return True


def read_holder(folder: Path | str) -> dict[str, Any]:
    """What the lock file says of the last run on a folder: ``pid``, ``host``, ``since``, ``token``, ``system``."""
    try:
        found = read_json(Path(folder) / FILE_NAME, DatasetError, "a lock")
    except DatasetError:
        return {}
    return found if isinstance(found, dict) else {}


def at_work(folder: Path | str) -> str | None:
    """Which run is at work in a folder now, in words; None where none is. Nothing is waited for, or written."""
    holder = read_holder(folder)
    if not holder or holder.get("released"):
        return None
    try:
        with open(Path(folder) / FILE_NAME, encoding="utf-8") as handle:
            _look(handle)
    except OSError as error:
        return _in_words(holder) if error.errno in _TAKEN or FolderLock._lives(holder) else None
    return None  # it was killed


def _in_words(holder: dict[str, Any]) -> str:
    pid, host, since = holder.get("pid", "?"), holder.get("host", "an unknown machine"), holder.get("since", "?")
    return f"process {pid} on {host}, since {since}"


class FolderLock:
    """A context in which no other run may write to ``folder``.

    The file keeps the path of the ``system`` description, so that a repair finds it again. Raises ``kind`` if another
    run is at it, or the folder cannot be written to.
    """

    def __init__(self, folder: Path, system: str = "", *, kind: type[ZeroshotError] = DatasetError) -> None:
        self.folder = folder
        self.token = uuid.uuid4().hex
        self._system, self._kind = system, kind
        self._handle: IO[str] | None = None

    def __enter__(self) -> FolderLock:
        path = self.folder / FILE_NAME
        before = read_holder(self.folder)
        try:
            handle = open(path, "a+", encoding="utf-8")
        except OSError as error:
            raise self._kind(f"{path}: cannot be written: {error.strerror}; expected a folder to write to") from None
        try:
            _take(handle)
        except OSError as error:
            if error.errno in _TAKEN or self._lives(before):
                handle.close()
                hint = "" if error.errno in _TAKEN else f"; if it was killed, remove {path}"
                raise self._kind(
                    f"{self.folder}: another run is at it ({_in_words(before)}); wait for it, or stop it and run again"
                    f"{hint}"
                ) from None
            if error.errno not in _CANNOT_LOCK:
                handle.close()
                raise self._kind(
                    f"{path}: cannot be locked: {error.strerror}; expected a folder on a local disk, or on a"
                    " file system with locks"
                ) from None
            _log.warning(
                "%s: its file system has no locks (%s); give no second command on this folder until this one has ended",
                *(self.folder, error.strerror),
            )
        self._handle = handle
        self._write({"token": self.token, "system": self._system or before.get("system", "")}, path)
        return self

    def _write(self, record: dict[str, Any], path: Path) -> None:
        assert self._handle is not None
        who = {"pid": os.getpid(), "host": socket.gethostname(), "since": time.strftime("%Y-%m-%d %H:%M:%S")}
        try:
            self._handle.seek(0)
            self._handle.truncate()
            self._handle.write(json.dumps({**who, **record}) + "\n")
            self._handle.flush()
        except OSError as error:
            self._handle.close()
            raise self._kind(f"{path}: cannot be written: {error.strerror}") from None

    @staticmethod
    def _lives(holder: dict[str, Any]) -> bool:
        """Where the file system knows no locks: whether the last holder seems to be still there."""
        if not holder or holder.get("released"):
            return False
        pid = holder.get("pid")
        here = holder.get("host") == socket.gethostname()
        return not here or (isinstance(pid, int) and _exists(pid))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._handle is not None:
            try:
                self._write({"system": self._system, "released": True}, self.folder / FILE_NAME)
            except ZeroshotError:  # a full disk: the lock is what matters, and it goes with the handle
                pass
            finally:
                self._handle.close()
                self._handle = None
