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


def test_where_the_user_wants_locks_that_cannot_be_had_the_error_names_them(tmp_path, without_locks):
    done = carried_out(tmp_path, without_locks | {LOCKING: "TRUE"})
    assert done.returncode
    assert f"HDF5 gets no lock there; set {LOCKING}=FALSE" in done.stderr.splitlines()[-1]


def test_a_file_that_another_program_has_locked_is_read(tmp_path):
    import fcntl

    write_netcdf(xr.Dataset({"a": ("time", np.arange(3.0))}), tmp_path / "a.nc", {})
    with open(tmp_path / "a.nc", "rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert read_netcdf(tmp_path / "a.nc", DatasetError, "a file")["a"].values.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("settings", [{}, {"LC_ALL": "C", "PYTHONUTF8": "0"}], ids=["utf-8", "ascii"])
@pytest.mark.parametrize("name", [b"B\xfcro", "Büro".encode()], ids=["latin-1", "utf-8"])
def test_a_folder_is_written_to_and_read_whatever_its_name(tmp_path, name, settings):
    folder = tmp_path / os.fsdecode(name)
    folder.mkdir()
    done = carried_out(folder, environment() | settings)
    assert done.stdout == "[0.0, 1.0, 2.0]\n", done.stderr
    assert sorted(one.name for one in folder.iterdir()) == [".lock", "a.nc"]
