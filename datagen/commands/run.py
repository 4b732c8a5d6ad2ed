"""The command ``datagen run``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from datagen.farming.usual import FAILURE_BUDGET, TIMEOUT
from shared.console import OK, PARTLY, Place, new_console, resumable
from shared.errors import ZeroshotError
from shared.logs import USUAL, Reporting

console = new_console()


@resumable()
def run(
    system: Path,
    *,
    out: Place,
    systems: int | None = None,
    preset: str | None = None,
    hours: float | None = None,
    step: float | None = None,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    cluster: str = "local",
    cluster_option: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None,
    host: str | None = None,
    shard_size: int = 10,
    excitation: bool = True,
    calm: float = 0.0,
    uncertain: Annotated[bool, Parameter(negative=())] = False,
    disturbed: float = 0.0,
    extend: Annotated[bool, Parameter(negative=())] = False,
    retry_failures: Annotated[bool, Parameter(negative=())] = False,
    failure_budget: float = FAILURE_BUDGET,
    timeout: float = TIMEOUT,
    report: Reporting = USUAL,
) -> int:
    """Simulate random systems into a dataset folder. Run again to resume an unfinished one.

    Exit code 3 if systems have failed. The dataset is complete otherwise.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    out
        Dataset folder; made if it does not exist.
    systems
        How many systems.
    preset
        Take systems, hours, step and season from this preset of the description, unless they are given here.
    hours
        Length of each record [h]; by default the description's.
    step
        Output step [s]; by default the description's.
    seed
        Root seed. With a system's index it decides everything about that system.
    workers
        Worker processes on this machine, by default one a core; with `--cluster slurm` the number of jobs.
    scheduler
        Address of a running Dask scheduler, in place of workers on this machine.
    cluster
        `local`, or `slurm` to submit the workers as jobs.
    cluster_option
        Settings of a Slurm job, as NAME=VALUE: queue, account, walltime, memory, cores, interface, log_directory, and
        others of dask_jobqueue.SLURMCluster. Repeat one that is a list, such as job_extra_directives.
    host
        Address that the scheduler listens on. Default: loopback, which other machines do not reach. `--cluster slurm`
        needs this or the option interface.
    shard_size
        Systems per file.
    excitation
        Add the description's small sinusoids to the control actions.
    calm
        Share of the systems, drawn by chance, without excitation. An estimator reads only kinds that it was trained on.
    uncertain
        Draw the description's [[uncertain]] constants for each system. An estimator for real buildings needs this.
    disturbed
        Share of the systems on which one or two of the description's effects act, each as a random process. Intervals
        then cover rooms that differ from the model.
    extend
        Add systems to a dataset that has fewer. Its shards stay as they are.
    retry_failures
        Simulate the systems in failures.jsonl again, together with the others of their shards.
    failure_budget
        Share of the systems, 0 to 1, that may fail before the run is stopped. Below 0.5 a run also stops when more
        than half of its first twenty or more have failed, unless with --retry-failures.
    timeout
        Seconds that one system may take before it counts as failed.
    """
    from datagen import run as run_

    manifest = run_(
        system,
        out,
        systems=systems,
        preset=preset,
        hours=hours,
        step=step,
        seed=seed,
        workers=workers,
        scheduler=scheduler,
        cluster=cluster,
        cluster_options=_options(cluster_option or []),
        host=host,
        shard_size=shard_size,
        excitation=excitation,
        calm=calm,
        uncertain=uncertain,
        disturbed=disturbed,
        extend=extend,
        retry_failures=retry_failures,
        failure_budget=failure_budget,
        timeout=timeout,
        quiet=report.quiet,
    )
    done = sum(len(entry.systems) for entry in manifest.shards)
    if not report.quiet:
        console.print(f"{done} of {manifest.systems} systems in {out}", markup=False)
        if done < manifest.systems:
            console.print(f"{manifest.systems - done} failed: see {out / 'failures.jsonl'}", markup=False)
    return OK if done == manifest.systems else PARTLY


def _options(words: list[str]) -> dict[str, str]:
    pairs = [word.partition("=") for word in words]
    for name, sign, _ in pairs:
        if not sign:
            raise ZeroshotError(f"--cluster-option {name!r}; expected NAME=VALUE")
    found: dict[str, str] = {}
    for name, _, value in pairs:  # what is given several times is a list, one item a line
        found[name] = f"{found[name]}\n{value}" if name in found else value
    return found
