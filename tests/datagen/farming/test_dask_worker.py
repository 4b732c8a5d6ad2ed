"""A worker that goes is gone, whatever its libraries do at the end of a process."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

HANGS = """
import atexit, ctypes
from datagen.farming.dask_worker import end_within
libc = ctypes.PyDLL(None)  # calls hold the interpreter's lock: no thread of Python could end this
atexit.register(libc.sleep, 60)
end_within(1)
"""


@pytest.mark.skipif(not hasattr(signal, "alarm"), reason="no alarms on Windows")
def test_a_process_that_hangs_at_its_end_is_ended():
    began = time.monotonic()
    ended = subprocess.run([sys.executable, "-c", HANGS], timeout=50, check=False)
    assert ended.returncode == -signal.SIGALRM
    assert time.monotonic() - began < 30
