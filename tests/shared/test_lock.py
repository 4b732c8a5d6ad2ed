"""One process at a time on a folder."""

import errno
import os
import socket
import subprocess
import sys

import pytest

from shared import lock
from shared.errors import DatasetError, EstimatorError
from shared.lock import FolderLock, at_work, read_holder

HOLD = (
    "import sys, time; from pathlib import Path; from shared.lock import FolderLock\n"
    "lock = FolderLock(Path(sys.argv[1])); lock.__enter__(); print('held', flush=True); time.sleep(60)"
)


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the lock of the folder."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()


def test_the_lock_of_a_killed_run_is_free_and_who_is_at_work_is_known_to_who_only_looks(tmp_path, holder):
    with pytest.raises(DatasetError, match=f"process {holder.pid} on"), FolderLock(tmp_path):
        pass
    assert at_work(tmp_path).startswith(f"process {holder.pid} on {socket.gethostname()}, since 2")
    holder.kill()
    holder.wait()
    assert at_work(tmp_path) is None  # though the file still names it
    assert read_holder(tmp_path)["pid"] == holder.pid
    with FolderLock(tmp_path):
        said = at_work(tmp_path)
        assert said is not None
        assert f"process {os.getpid()} on" in said
    assert at_work(tmp_path) is None
    assert at_work(tmp_path / "nowhere") is None


def test_where_files_cannot_be_locked_it_counts_whether_the_holder_lives(tmp_path, holder, monkeypatch):
    def cannot(_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock, "_take", cannot)
    with pytest.raises(EstimatorError, match=f"process {holder.pid} on"), FolderLock(tmp_path, kind=EstimatorError):
        pass
    holder.kill()
    holder.wait()
    with FolderLock(tmp_path, kind=EstimatorError):
        pass
    assert read_holder(tmp_path)["released"] is True
    with FolderLock(tmp_path):
        pass
