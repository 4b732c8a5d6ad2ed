"""Programs that start a farm, and what workers share: scripts without a guard, forks, FMUs of one name, the GIL."""

import subprocess
import sys

import dask
import numpy as np
import pytest
from dask.distributed import LocalCluster

from datagen import run
from shared.children import environment
from shared.store import DatasetFolder
from tests.datagen.faults import faulty, run_here, shards_in

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="no fork there")]
SIZE = {"systems": 2, "seed": 3, "shard_size": 1, "hours": 24}
SCRIPT = f"""
import sys
import datagen
print("begun", flush=True)
datagen.run(sys.argv[1], sys.argv[2], workers=2, quiet=True, **{SIZE})
"""


@pytest.fixture(scope="module")
def tanks(tank, tmp_path_factory):
    """Two FMUs of one file name, model name and identifier, of which the second fills up twice as fast."""
    folder = tmp_path_factory.mktemp("other")
    faulty.build(folder, ("dx[0] = t->v[INFLOW]", "dx[0] = 2 * t->v[INFLOW]"))
    return [tank, faulty.describe(folder)]


def values(folder):
    return DatasetFolder(folder).load().values


@pytest.fixture(scope="module")
def alone(tanks, tmp_path_factory):
    """The levels of both, simulated in this process: shapes (systems, 1, time)."""
    folder = tmp_path_factory.mktemp("alone")
    for k, one in enumerate(tanks):
        run_here(one, folder / f"{k}", **SIZE)
    found = [values(folder / f"{k}") for k in range(2)]
    assert not np.allclose(*found, rtol=0.1)
    return found


def test_a_script_without_a_guard_has_its_farm_of_two_workers(tanks, alone, tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    env = environment()
    words = [sys.executable, "script.py", str(tanks[0]), "ds"]
    done = subprocess.run(words, env=env, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, "begun\n"), done.stderr
    np.testing.assert_array_equal(values(tmp_path / "ds"), alone[0])


def test_two_fmus_of_one_name_are_two_in_one_farm(tanks, alone, tmp_path, taken_to_be_alive):
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        for name, one in zip(("one", "other"), tanks, strict=True):
            run(one, tmp_path / name, scheduler=cluster.scheduler_address, quiet=True, **SIZE)
    for name, expected in zip(("one", "other"), alone, strict=True):
        np.testing.assert_array_equal(values(tmp_path / name), expected)


def test_a_worker_whose_fmu_holds_the_interpreter_is_waited_for(tanks, alone, tmp_path, caplog, taken_to_be_alive):
    """It sends no heartbeat for two seconds, where Dask would bear half a second: as ten minutes are to five."""
    held = faulty.describe(tanks[0].parent, fault=5, above=1e-9)
    with dask.config.set({"distributed.scheduler.worker-ttl": "0.5s"}), caplog.at_level("DEBUG", "zeroshot"):
        run(held, tmp_path / "ds", workers=1, quiet=True, **SIZE)
    np.testing.assert_array_equal(values(tmp_path / "ds"), alone[0])
    assert len(shards_in(tmp_path / "ds")) == 2
    assert "died" not in caplog.text and "tried again" not in caplog.text
