"""What a run opens to the network: nothing beyond this machine, unless it is told otherwise."""

import psutil
import pytest

from datagen.farming.cluster import connect


def listening():
    """Addresses at which this process and all that it started wait for connections."""
    here = psutil.Process()
    found = set()
    for process in (here, *here.children(recursive=True)):
        for one in process.net_connections(kind="tcp"):
            if one.status == psutil.CONN_LISTEN:
                found.add((one.laddr.ip, one.laddr.port))
    return found


@pytest.mark.slow
def test_scheduler_workers_and_dashboard_listen_on_loopback_alone():
    before = listening()
    with connect(workers=1) as client:
        opened = listening() - before
        scheduler = client.scheduler_info()["address"]
        dashboard = client.dashboard_link
    assert len(opened) >= 3  # scheduler, worker, dashboard
    assert {ip for ip, _ in opened} <= {"127.0.0.1", "::1"}
    assert scheduler.startswith("tcp://127.0.0.1:")
    assert dashboard.startswith("http://127.0.0.1:")
