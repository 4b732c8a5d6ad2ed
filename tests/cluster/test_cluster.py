"""Workers that are not ours: behind a scheduler, without our files, of another version, as Slurm's jobs.

Slurm's test needs a Slurm: ``tests/cluster/slurm.sh start`` makes one of this machine (as root) and prints SLURM_CONF.
"""

import os
import shutil
import socket
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace

import pytest
from dask.distributed import Client

from datagen import run, verify
from datagen.farming.cluster import ClusterError
from datagen.farming.worker import Job, simulate_shard
from shared.errors import DatasetError
from shared.system import load_system
from tests.datagen.faults import faulty, hashes, run_here, wait_for

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


@contextmanager
def scheduler_with(before):
    """A scheduler, and a worker behind it; ``before`` is put in front of the worker's command."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        place = probe.getsockname()
    address = f"tcp://127.0.0.1:{place[1]}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", address, "--no-dashboard"]
    scheduler = subprocess.Popen(start, **quiet)
    start = [*before, sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny"]
    worker = subprocess.Popen(start, **quiet)

    def listens():
        with socket.socket() as probe:
            return probe.connect_ex(place) == 0

    try:
        wait_for(listens)  # a busy machine takes its time to start a process
        yield address
    finally:
        for process in (worker, scheduler):
            process.terminate()
            process.wait(20)


def test_workers_that_see_none_of_our_files_get_the_fmu_and_hand_the_shards_back(tanks, tmp_path):
    toml = faulty.describe(tanks)
    hide = ["unshare", "-m", "sh", "-c", 'mount -t tmpfs tmpfs "$0" && mount -t tmpfs tmpfs "$1" && shift && exec "$@"']
    hide += [str(tanks), str(tmp_path)]
    if subprocess.run([*hide, "true"], capture_output=True).returncode:
        pytest.skip("only root can hide a folder from a process")
    run_here(toml, tmp_path / "here", **SIZE)
    with scheduler_with(hide) as address:
        run(toml, tmp_path / "there", scheduler=address, quiet=True, **SIZE)
    assert hashes(tmp_path / "there") == hashes(tmp_path / "here")
    assert verify(tmp_path / "there") == []


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
