"""What Slurm's cluster is asked for, with dask-jobqueue's class in place of a queue."""

import sys
from types import SimpleNamespace

import pytest

from datagen.cluster import QUEUES, connect
from datagen.slurm import slurm
from shared.errors import ClusterError

LISTENING = {"host": "10.0.0.1", "dashboard_address": "127.0.0.1:0"}


class Queue:
    """Remembers what it was made with; knows no option ``nonsense``."""

    def __init__(self, **options):
        if "nonsense" in options:
            raise TypeError("nonsense is not known")
        self.options = options

    def adapt(self, **limits):
        self.limits = limits


@pytest.fixture
def queue(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask_jobqueue", SimpleNamespace(SLURMCluster=Queue))


@pytest.mark.usefixtures("queue")
def test_jobs_are_replaced_and_options_reach_the_queue():
    made = slurm(7, {"cores": "4", "memory": "9GiB", "account": "heat"}, LISTENING)
    assert (made.limits["minimum_jobs"], made.limits["maximum_jobs"]) == (7, 7)
    asked = made.options
    assert (asked["cores"], asked["processes"], asked["interface"]) == (4, 4, None)
    assert (asked["memory"], asked["account"], asked["walltime"]) == ("9GiB", "heat", "24:00:00")
    assert asked["scheduler_options"] == LISTENING


@pytest.mark.usefixtures("queue")
def test_an_interface_takes_the_place_of_the_host():
    asked = slurm(1, {"interface": "ib0"}, LISTENING).options
    assert asked["interface"] == "ib0"
    assert asked["scheduler_options"] == {"dashboard_address": "127.0.0.1:0"}


@pytest.mark.usefixtures("queue")
def test_an_option_that_is_not_known_is_a_sentence():
    with pytest.raises(ClusterError, match="cluster options: nonsense is not known; expected those of"):
        slurm(1, {"nonsense": "1"}, LISTENING)


def test_without_dask_jobqueue_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask_jobqueue", None)
    with pytest.raises(ClusterError, match=r"install zeroshot-fmu\[cluster\]"):
        slurm(1, {}, LISTENING)


def test_a_kind_is_one_line_and_listens_on_loopback(monkeypatch):
    asked = []

    def made(*what):
        asked.append(what)
        raise ClusterError("asked")

    monkeypatch.setitem(QUEUES, "mine", made)
    with pytest.raises(ClusterError, match="asked"), connect(cluster="mine", workers=3, options={"queue": "night"}):
        pass
    assert asked == [(3, {"queue": "night"}, {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"})]
    with pytest.raises(ClusterError, match="expected local or slurm or mine"), connect(cluster="yours"):
        pass
