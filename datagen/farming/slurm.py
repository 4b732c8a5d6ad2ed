"""Workers that are jobs of Slurm, by dask-jobqueue."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import dask

from datagen.farming.dask_settings import worker_exports
from datagen.farming.jobs import Keeper
from shared.errors import ClusterError

_MEMORY = 2
"""Memory of a job by default [GiB per core]: each core has a worker, and an idle one takes 0.4 already."""
_EARLY = 300.0
"""Workers leave so long before their job ends [s], give or take half, or a tenth of its time if that is less."""
_WHOLE = ("cores", "job_cpu")
_LISTS = (
    *("job_extra_directives", "job_directives_skip", "job_script_prologue", "worker_extra_args"),
    *("job_extra", "header_skip", "env_extra", "extra"),  # what these were called before
)
"""Options that dask-jobqueue takes as lists; a string in place of one would be taken letter by letter."""


def slurm(jobs: int, options: dict[str, str], listening: dict[str, str]) -> Any:
    """A cluster of jobs, each replaced when it ends.

    Raises ClusterError if Slurm or dask-jobqueue is missing, the latter does not know an option or cannot use its
    value, or no job is taken.

    Parameters
    ----------
    options
        ``cores``, ``interface``, and those of dask_jobqueue.SLURMCluster; a list has one item a line. ``memory`` is
        a whole job's.
    listening
        Of the scheduler; with an ``interface`` that takes the place of its host.
    """
    try:
        from dask_jobqueue import SLURMCluster
    except ImportError:
        raise ClusterError("cluster slurm needs dask-jobqueue; install zeroshot-fmu[cluster]") from None
    if shutil.which("sbatch") is None:
        raise ClusterError("cluster slurm: no sbatch on the PATH; expected a machine where jobs can be submitted")
    given = {name: _value(name, text) for name, text in options.items()}
    interface = given.pop("interface", None)
    cores = given.pop("cores", 1)
    # what is given here takes the place of Dask's configuration, so the lines that a site has there are said again
    configured = dask.config.get("jobqueue.slurm.job-script-prologue", None) or []
    prologue = given.pop("job_script_prologue", None) or given.pop("env_extra", None) or configured
    scheduler_options = {name: one for name, one in listening.items() if name != "host" or interface is None}
    settings: dict[str, Any] = {
        "memory": f"{_MEMORY * cores}GiB",
        "walltime": "24:00:00",
        "log_directory": _log_directory(),
        **given,
        "job_script_prologue": [*worker_exports(), *prologue],
    }
    extra = given.get("worker_extra_args") or settings.pop("extra", None)
    extra = extra or dask.config.get("jobqueue.slurm.worker-extra-args", None) or []
    settings["worker_extra_args"] = [*_lifetime(str(settings["walltime"]), extra), *extra]
    try:
        cluster = SLURMCluster(
            cores=cores,
            processes=cores,
            interface=interface,
            scheduler_options=scheduler_options,
            silence_logs="error",
            **settings,
        )
    except (TypeError, ValueError) as error:
        words = str(error).partition("\n")[0].partition(". ")[0]  # its own go on with all options, over several lines
        raise ClusterError(f"cluster options: {words}; expected those of dask_jobqueue.SLURMCluster") from None
    except OSError as error:
        where = settings["log_directory"]
        raise ClusterError(
            f"cluster option log_directory is {where}, which cannot be written: {error.strerror or error}; expected a "
            "folder that the jobs' nodes share with this machine"
        ) from None
    Keeper(cluster, jobs, settings["log_directory"]).begin()
    return cluster


def _lifetime(walltime: str, extra: list[str]) -> list[str]:
    """Have workers leave in order before their job's time is up: a shard that one dies over is suspected to be why.

    Nothing where the time is not limited, or the options of a worker have a lifetime already.
    """
    found = re.fullmatch(r"(?:(\d+)-)?(\d+)(?::(\d+))?(?::(\d+))?", walltime)
    if found is None or any("--lifetime" in one for one in extra):
        return []
    days, *parts = found.groups()
    given = [int(one) for one in parts if one is not None]
    if days is None and len(given) < 3:  # minutes, minutes:seconds
        given = [0, *given]
    hours, minutes, seconds = [*given, 0, 0][:3]
    total = ((int(days or 0) * 24 + hours) * 60 + minutes) * 60 + seconds
    early = min(_EARLY, total / 10)
    return [f"--lifetime {total - early:.0f}s", f"--lifetime-stagger {early / 2:.0f}s"]


def _value(name: str, text: str) -> Any:
    """An option as dask-jobqueue takes it."""
    if name in _LISTS:
        return text.splitlines()
    if "\n" in text:
        raise ClusterError(f"cluster option {name} is {' and '.join(text.split(chr(10)))}; expected one value")
    if name in _WHOLE:
        if not text.isdecimal() or int(text) < 1:
            raise ClusterError(f"cluster option {name} is {text!r}; expected a whole number of at least 1")
        return int(text)
    if name == "log_directory":
        return str(Path(text).expanduser())
    return text


def _log_directory() -> str | None:
    """Where jobs write what they say: Slurm starts none whose folder is missing on its node, and homes are shared."""
    configured = dask.config.get("jobqueue.slurm.log-directory", None)
    if configured:
        return str(configured)
    try:
        return str(Path.home() / ".zeroshot-fmu" / "slurm")
    except RuntimeError:  # nobody's home: Slurm then writes where the job was submitted
        return None
