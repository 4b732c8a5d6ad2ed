"""How Dask is set up for a farm, and the same for workers that another machine starts."""

from __future__ import annotations

from typing import Any

SETTINGS: dict[str, Any] = {
    # a shard whose worker died comes back at once: the farm itself finds out whose fault it was
    "distributed.scheduler.allowed-failures": 0,
    # an FMU may hold the interpreter for minutes; hanging is for the per-system timeout to judge
    "distributed.scheduler.worker-ttl": None,
    # a worker above its share of memory is ended, never paused for good
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
}

OWN_CLUSTER: dict[str, Any] = {
    # a worker that leaves is replaced by its nanny, which Dask would close for good if at that moment, so long after an
    # earlier one has left, there is none; whether none comes is for the farm's own patience to judge, and for the
    # keeper of a queue's jobs
    "distributed.deploy.lost-worker-timeout": "10 days",
}
"""More, for a cluster that the farm starts itself."""


def worker_exports() -> list[str]:
    """Lines of a shell script that give a worker its share of the settings: it does not see our configuration."""
    return [
        f"export DASK_{name.upper().replace('.', '__').replace('-', '_')}={value}"
        for name, value in SETTINGS.items()
        if name.startswith("distributed.worker.")
    ]
