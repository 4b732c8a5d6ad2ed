"""What Slurm's cluster is asked for, with dask-jobqueue's class in place of a queue."""

import shutil
import sys
from types import SimpleNamespace

import dask
import pytest

from datagen.commands.run import _options
from datagen.farming.cluster import _CONFIG
from datagen.farming.slurm import slurm
from shared.errors import ClusterError

LISTENING = {"host": "10.0.0.1", "dashboard_address": "127.0.0.1:0"}


class Queue:
    """Remembers what it was made with; knows no option ``nonsense``."""

    def __init__(self, **options):
        if "nonsense" in options:
            raise TypeError("nonsense is not known")
        self.options = options


class Keeper:
    """Remembers how many jobs it was to keep."""

    def __init__(self, cluster, jobs, where):
        cluster.kept = jobs, where

    def begin(self):
        pass


@pytest.fixture(autouse=True)
def submitting(monkeypatch, tmp_path):
    """A machine where jobs can be submitted, and a home of nobody's."""
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setenv("HOME", str(tmp_path))


@pytest.fixture
def queue(monkeypatch):
    monkeypatch.setattr("datagen.farming.slurm.Keeper", Keeper)
    monkeypatch.setitem(sys.modules, "dask_jobqueue", SimpleNamespace(SLURMCluster=Queue))


@pytest.mark.usefixtures("queue")
def test_jobs_are_kept_and_options_reach_the_queue(tmp_path):
    made = slurm(7, {"cores": "4", "memory": "9GiB", "account": "heat"}, LISTENING)
    assert made.kept == (7, str(tmp_path / ".zeroshot-fmu" / "slurm"))
    asked = made.options
    assert (asked["cores"], asked["processes"], asked["interface"]) == (4, 4, None)
    assert (asked["memory"], asked["account"], asked["walltime"]) == ("9GiB", "heat", "24:00:00")
    assert asked["scheduler_options"] == LISTENING


def test_the_job_script_has_a_workers_settings_and_each_directive_whole(monkeypatch, tmp_path):
    monkeypatch.setattr("datagen.farming.slurm.Keeper", Keeper)  # submits nothing
    words = ["job_extra_directives=--exclusive", "job_extra_directives=--qos=long run", "job_cpu=3"]
    words += ["job_script_prologue=module load python", "worker_extra_args=--resources a=1"]
    listening = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
    with slurm(1, _options(words), listening) as cluster:
        lines = cluster.job_script().splitlines()
    directives = [line.removeprefix("#SBATCH ") for line in lines if line.startswith("#SBATCH")]
    assert directives[-2:] == ["--exclusive", "--qos=long run"]
    assert "--cpus-per-task=3" in directives
    assert f"-o {tmp_path}/.zeroshot-fmu/slurm/dask-worker-%J.out" in directives
    exports = dict(line.removeprefix("export ").split("=") for line in lines if line.startswith("export "))
    workers = {name: value for name, value in _CONFIG.items() if name.startswith("distributed.worker.")}
    assert len(workers) == 4
    with dask.config.set(dask.config.collect_env(exports)):
        assert {name: dask.config.get(name) for name in workers} == workers
    assert lines.index("module load python") > max(k for k, line in enumerate(lines) if line.startswith("export "))
    assert lines[-1].endswith(" --lifetime 86100s --lifetime-stagger 150s --resources a=1")


@pytest.mark.usefixtures("queue")
@pytest.mark.parametrize(
    ("walltime", "words"),
    [
        ("04:00:00", ["--lifetime 14100s", "--lifetime-stagger 150s"]),
        ("30", ["--lifetime 1620s", "--lifetime-stagger 90s"]),
        ("1-00:30", ["--lifetime 87900s", "--lifetime-stagger 150s"]),
        ("UNLIMITED", []),
    ],
)
def test_workers_leave_before_their_job_ends(walltime, words):
    assert slurm(1, {"walltime": walltime}, LISTENING).options["worker_extra_args"] == words
    own = slurm(1, {"walltime": walltime, "extra": "--lifetime 5m"}, LISTENING).options
    assert own["worker_extra_args"] == ["--lifetime 5m"] and "extra" not in own
    with dask.config.set({"jobqueue.slurm.worker-extra-args": ["--resources a=1"]}):
        assert slurm(1, {"walltime": walltime}, LISTENING).options["worker_extra_args"] == [*words, "--resources a=1"]


@pytest.mark.usefixtures("queue")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["cores=two"], "cores is 'two'; expected a whole number of at least 1"),
        (["queue=a", "queue=b"], "queue is a and b; expected one value"),
        (["nonsense=1"], "cluster options: nonsense is not known; expected those of"),
    ],
)
def test_a_value_that_cannot_be_used_is_a_sentence(words, said):
    with pytest.raises(ClusterError, match=said):
        slurm(1, _options(words), LISTENING)


def test_without_dask_jobqueue_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    with pytest.raises(ClusterError, match=r"install zeroshot-fmu\[cluster\]"):
        slurm(1, {}, LISTENING)
