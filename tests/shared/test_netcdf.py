"""NetCDF files where the file system knows no locks, somebody else has one, or a path is not UTF-8."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from shared import LOCKING
from shared.children import environment
from shared.errors import DatasetError
from shared.netcdf import read_netcdf, write_netcdf

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="a shared library in front of the C library's")

WITHOUT_LOCKS = (
    "#include <errno.h>\nint flock(int file, int how) { (void)file; (void)how; errno = ENOLCK; return -1; }\n"
)
ROUND = """
import sys
from pathlib import Path
import numpy as np, xarray as xr
from shared.errors import DatasetError
from shared.lock import FolderLock
from shared.netcdf import read_netcdf, write_netcdf
folder = Path(sys.argv[1])
with FolderLock(folder):
    write_netcdf(xr.Dataset({"a": ("time", np.arange(3.0))}), folder / "a.nc", {})
    print(read_netcdf(folder / "a.nc", DatasetError, "a file")["a"].values.tolist())
"""


@pytest.fixture(scope="module")
def without_locks(tmp_path_factory):
    """Environment of a process that sees no file system with locks."""
    folder = tmp_path_factory.mktemp("shim")
    (folder / "shim.c").write_text(WITHOUT_LOCKS)
    compiler = ["gcc"] if shutil.which("gcc") else [sys.executable, "-m", "ziglang", "cc"]
    try:
        subprocess.run([*compiler, "-shared", "-fPIC", "-o", folder / "shim.so", folder / "shim.c"], check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no compiler here")
    return environment() | {"LD_PRELOAD": str(folder / "shim.so")}


def carried_out(folder, env):
    words = [sys.executable, "-c", ROUND, os.fsencode(folder)]
    return subprocess.run(words, env=env, capture_output=True, text=True, encoding="utf-8", errors="replace")


def test_a_file_system_without_locks_is_written_to_and_read_and_a_run_says_so(tmp_path, without_locks):
    without_locks = {name: value for name, value in without_locks.items() if name != LOCKING}
    done = carried_out(tmp_path, without_locks)
    assert done.stdout == "[0.0, 1.0, 2.0]\n", done.stderr
    assert done.stderr == (
        f"{tmp_path}: its file system has no locks (No locks available); give no second command on this folder until"
        " this one has ended\n"
    )


def test_a_file_that_another_program_has_locked_is_read(tmp_path):
    import fcntl

    write_netcdf(xr.Dataset({"a": ("time", np.arange(3.0))}), tmp_path / "a.nc", {})
    with open(tmp_path / "a.nc", "rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert read_netcdf(tmp_path / "a.nc", DatasetError, "a file")["a"].values.tolist() == [0.0, 1.0, 2.0]


def test_a_path_that_is_no_text_is_a_sentence_before_any_work(tmp_path):
    folder, settings = tmp_path / "Büro", {"LC_ALL": "C", "PYTHONUTF8": "0"}
    said = r"B\xc3\xbcro/x.nc is no text in ascii, this process's encoding; set PYTHONUTF8=1, or LC_ALL=C.UTF-8"
    folder.mkdir()
    words = [sys.executable, "-m", "datagen.cli", "simulate", "MixedAirCO2", "--out", os.fsencode(folder / "x.nc")]
    done = subprocess.run(words, env=environment() | settings, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == f"error: {tmp_path}/{said}\n"
    assert list(folder.iterdir()) == []
