"""Readers of NetCDF files that are forked for tests: as those that are started, each with its own end."""

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from shared.children import command, environment
from tests.forked import Forked

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="they are started there, as users have them")
HOW = {"stdin": subprocess.DEVNULL, "capture_output": True, "timeout": 60}


@pytest.fixture(scope="module")
def forked():
    one = Forked()
    yield one
    one.close()


def how(**more):
    """How a reader is started."""
    return HOW | {"env": environment() | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}} | more


def words(path, most="1000000"):
    return command("shared.netcdf_child", str(path), most, "10")


def test_what_comes_back_is_what_a_started_one_says(forked, tmp_path, monkeypatch):
    path = tmp_path / "a.nc"
    xr.Dataset({"a": ("time", np.arange(30000.0))}).to_netcdf(path)
    (tmp_path / "bad.nc").write_bytes(b"rubbish")
    cases = [words(path, "8"), words(tmp_path / "bad.nc"), words(path)]
    begun = [subprocess.run(one, **how()) for one in cases]
    monkeypatch.setattr(subprocess, "run", None)  # none of them is started
    for one, before in zip(cases, begun, strict=True):
        after = forked.run(one, **how())
        assert (after.returncode, after.stdout, after.stderr) == (before.returncode, before.stdout, before.stderr)
    assert [one.returncode for one in begun] == [1, 1, 0]
