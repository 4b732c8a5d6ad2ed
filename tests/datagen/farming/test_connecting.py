"""Workers that cannot be had, or are lost: a sentence about the workers, never one about the dataset's folder."""

import pytest
from distributed.comm import CommClosedError

from datagen import run
from datagen.farming.cluster import connect
from shared.errors import ClusterError


class Cluster:
    """In place of Dask's: may fail when it starts."""

    starts: BaseException | None = None
    workers = ()
    dashboard_link = ""

    def __init__(self, **_):
        if self.starts is not None:
            raise self.starts

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass


@pytest.fixture
def cluster(monkeypatch):
    class Mine(Cluster):
        pass

    monkeypatch.setattr("datagen.farming.cluster.LocalCluster", Mine)
    monkeypatch.setattr("datagen.farming.cluster.Client", lambda *_, **__: Cluster())
    return Mine


def test_a_host_that_is_not_of_this_machine():
    host = "WRONG"
    with (
        pytest.raises(ClusterError, match=rf"cluster local did not start: \[Errno.*host is '{host}'; expected an add"),
        connect(workers=1, host=host),
    ):
        pass


@pytest.mark.parametrize("error", [TimeoutError(), RuntimeError("failed to start")])
def test_a_cluster_that_does_not_start(cluster, error):
    cluster.starts = error
    words = str(error) or "TimeoutError"
    with pytest.raises(ClusterError, match=f"cluster local did not start: {words}"), connect(workers=1):
        pass


@pytest.mark.usefixtures("cluster")
def test_a_connection_that_is_lost():
    error = CommClosedError("in the middle")
    with (
        pytest.raises(ClusterError, match=f"connection to the scheduler was lost: {error}; what was finished is kept"),
        connect(workers=1),
    ):
        raise error


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"cluster": "slurm", "host": ""}, "host is ''; expected its address or name, or none given"),
        ({"scheduler": ""}, "scheduler is ''; expected its address or name, or none given"),
        ({"scheduler": "tcp://here:"}, "expected tcp://HOST:PORT"),
        ({"scheduler": "tls://127.0.0.1:1"}, "no certificates are set"),
    ],
)
def test_what_is_no_place_is_refused_before_anything_is_written(tank, tmp_path, taken_to_be_alive, given, said):
    """Dask would refuse an address, too, and 40 s later print a traceback of a client that it cannot close."""
    with pytest.raises(ClusterError, match=said):
        run(tank, tmp_path / "ds", systems=2, **given)
    assert not (tmp_path / "ds").exists()
