"""Workers that are not ours: of another version, behind no scheduler, as Slurm's jobs; more in docker/test_farm.py.

Slurm's test needs a Slurm: ``tests/cluster/slurm.sh start`` makes one of this machine (as root) and prints SLURM_CONF.
"""

import os
import shutil
from dataclasses import replace

import pytest
from dask.distributed import Client

from datagen import run, verify
from datagen.farming.cluster import ClusterError
from datagen.farming.worker import Job, simulate_shard
from shared.errors import DatasetError
from shared.system import load_system
from tests.datagen.faults import faulty, hashes, run_here

pytestmark = pytest.mark.slow
SIZE = {"systems": 12, "seed": 3, "shard_size": 2}


@pytest.fixture(autouse=True)
def taken_to_be_alive(monkeypatch):
    """No FMU is tried in a process apart before a run: that has nothing to do with where the workers are."""
    monkeypatch.setattr("datagen.farming.farm.check_live_apart", lambda *_: None)


@pytest.fixture(scope="module")
def tanks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("faulty")
    faulty.build(folder)
    return folder


def test_a_worker_that_joins_later_checks_the_version_itself(tanks):
    system = load_system(faulty.describe(tanks))
    job = Job(system.canonical(), str(system.path), "0" * 64, 1, True, "")
    with pytest.raises(DatasetError, match=r"this run zeroshot-fmu 9\.9; expected the same version"):
        simulate_shard(replace(job, version="9.9"), "shard-000000.nc", [0])


def test_no_scheduler_is_a_sentence(tanks, tmp_path, monkeypatch):
    monkeypatch.setattr("datagen.farming.cluster.ANSWER", 2.0)
    with pytest.raises(ClusterError, match="no Dask scheduler answers"):
        run(faulty.describe(tanks), tmp_path / "ds", scheduler="tcp://127.0.0.1:1", **SIZE)
    # and nobody who computes or writes a file afterwards asks it for anything
    with pytest.raises(ValueError, match="No clients found"):
        Client.current()


def test_slurm_gives_the_same_data(tanks, tmp_path):
    if not shutil.which("sbatch"):
        pytest.skip("Slurm is not installed; tests/cluster/slurm.sh start installs and starts one")
    if not os.environ.get("SLURM_CONF"):
        pytest.skip("SLURM_CONF is not set; tests/cluster/slurm.sh start prints it")
    pytest.importorskip("dask_jobqueue")
    toml = faulty.describe(tanks)
    run_here(toml, tmp_path / "here", **SIZE)
    options = {"memory": "1GiB", "walltime": "00:10:00", "log_directory": str(tmp_path / "logs")}
    place = {"cluster": "slurm", "workers": 2, "host": "127.0.0.1"}  # a node of this machine
    run(toml, tmp_path / "slurm", cluster_options=options, quiet=True, **place, **SIZE)
    assert hashes(tmp_path / "slurm") == hashes(tmp_path / "here")
    assert verify(tmp_path / "slurm") == []
