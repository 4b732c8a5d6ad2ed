"""Workers that are jobs of Slurm, by dask-jobqueue."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from shared.errors import ClusterError


def slurm(jobs: int, options: dict[str, str], listening: dict[str, str]) -> Any:
    """A cluster of jobs, each replaced when it ends.

    Parameters
    ----------
    options
        ``cores``, ``interface``, and those of dask_jobqueue.SLURMCluster.
    listening
        Of the scheduler; with an ``interface`` that takes the place of its host.

    Raises
    ------
    ClusterError
        If dask-jobqueue is missing, or does not know an option.
    """
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise ClusterError("cluster slurm needs dask-jobqueue; install zeroshot-fmu[cluster]") from None
    interface = options.pop("interface", None)
    cores = int(options.pop("cores", "1"))
    scheduler_options = {name: one for name, one in listening.items() if name != "host" or interface is None}
    settings: dict[str, Any] = {"memory": "2GiB", "walltime": "24:00:00", **options}
    try:
        cluster = SLURMCluster(
            cores=cores,
            processes=cores,
            interface=interface,
            scheduler_options=scheduler_options,
            log_directory=str(Path(tempfile.gettempdir()) / "zeroshot-slurm"),
            silence_logs="error",
            **settings,
        )
    except (TypeError, ValueError) as error:
        raise ClusterError(f"cluster options: {error}; expected those of dask_jobqueue.SLURMCluster") from None
    # a job that ends, by its wall time or otherwise, is replaced
    cluster.adapt(minimum_jobs=jobs, maximum_jobs=jobs, interval="5s")
    return cluster
