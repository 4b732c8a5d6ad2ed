"""The command ``datagen``: thin shells over the functions of the same names."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from shared.assignments import assignments
from shared.console import FAULT, OK, new_app, new_console, start
from shared.errors import ZeroshotError

app = new_app(
    "datagen",
    "Simulate random systems of an FMU into a dataset that an estimator can learn from.\n\n"
    "A system description (TOML) names the FMU, its parameters, inputs and outputs; `datagen run` makes the dataset.",
)
console = new_console()


@app.command
def run(
    system: Path,
    *,
    out: Path,
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
    extend: Annotated[bool, Parameter(negative=())] = False,
    retry_failures: Annotated[bool, Parameter(negative=())] = False,
    failure_budget: float = 0.05,
    timeout: float = 600.0,
    quiet: bool = False,
) -> int:
    """Simulate random systems into a dataset folder. Run again to resume an unfinished one.

    Parameters
    ----------
    system
        System description (TOML), or its folder.
    out
        Dataset folder; made if it does not exist.
    systems
        How many systems.
    preset
        Take systems, hours and step from this preset of the description, where they are not given here.
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
        Of a Slurm job, as NAME=VALUE: queue, account, walltime, memory, cores, interface.
    host
        Address that our scheduler listens on. Loopback by default, which workers on other machines do not reach.
    shard_size
        Systems per file.
    excitation
        Add the description's small sinusoids to the control actions.
    extend
        Add systems to a dataset that has fewer; the shards that are there stay as they are.
    retry_failures
        Simulate the systems in failures.jsonl once more.
    failure_budget
        Share of the systems that may fail before the run is stopped.
    timeout
        Seconds that one system may take before it counts as failed.
    quiet
        No progress bar.
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
        extend=extend,
        retry_failures=retry_failures,
        failure_budget=failure_budget,
        timeout=timeout,
        quiet=quiet,
    )
    done = sum(len(entry.systems) for entry in manifest.shards)
    if not quiet:
        console.print(f"{done} of {manifest.systems} systems in {out}", markup=False)
        if done < manifest.systems:
            console.print(f"{manifest.systems - done} failed: see {out / 'failures.jsonl'}", markup=False)
    return OK if done == manifest.systems else FAULT


@app.command
def simulate(
    system: Path,
    *,
    out: Path,
    set_: Annotated[list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())] = None,
    hours: float | None = None,
    step: float | None = None,
    seed: int = 0,
    index: int = 0,
    excitation: bool = True,
) -> int:
    """Simulate one system into one NetCDF file, the shape in which recordings come.

    Parameters
    ----------
    system
        System description (TOML), or its folder.
    out
        The NetCDF file to write.
    set_
        Parameter values as NAME=VALUE; the others are drawn as the farm would for this seed and index.
    hours
        Length of the record [h]; by default the description's.
    step
        Output step [s]; by default the description's.
    seed
        Root seed of what is drawn: parameters that are not set, occupancy, weather file.
    index
        System index of what is drawn.
    excitation
        Add the description's small sinusoids to the control actions.
    """
    from datagen import simulate as simulate_

    record = simulate_(
        system,
        parameters=assignments(set_ or []),
        out=out,
        hours=hours,
        step=step,
        seed=seed,
        index=index,
        excitation=excitation,
    )
    table = Table("variable", "unit", "minimum", "mean", "maximum", box=None)
    for name, values in record.data_vars.items():
        if values.attrs.get("role") == "parameter":
            table.add_row(str(name), values.attrs["units"], "", f"{float(values):.5g}", "")
        elif values.attrs.get("role") == "output":
            low, mean, high = (f"{float(f()):.5g}" for f in (values.min, values.mean, values.max))
            table.add_row(str(name), values.attrs["units"], low, mean, high)
    console.print(table)
    console.print(f"written to {out}", markup=False)
    return OK


@app.command
def info(folder: Path, *, as_json: Annotated[bool, Parameter(name="--json", negative=())] = False) -> int:
    """Say what a dataset holds.

    Parameters
    ----------
    folder
        Dataset folder.
    as_json
        Print JSON.
    """
    from datagen import info as info_

    found = info_(folder)
    if as_json:
        sys.stdout.write(json.dumps(found, indent=1) + "\n")
        return OK
    table = Table(box=None, show_header=False)
    for name, value in found.items():
        text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
        table.add_row(name, text)
    console.print(table)
    return OK


@app.command
def verify(
    folder: Path,
    *,
    repair: Annotated[bool, Parameter(negative=())] = False,
    system: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Hold every shard of a dataset against its manifest. Exit code 1 if anything is wrong.

    Parameters
    ----------
    folder
        Dataset folder.
    repair
        Simulate damaged and missing shards again; they must come out as the manifest says.
    system
        System description for a repair, if the dataset was not made on this machine.
    as_json
        Print JSON.
    """
    from datagen import repair as repair_
    from datagen import verify as verify_

    mended = repair_(folder, system) if repair else []
    faults = verify_(folder)
    if as_json:
        found = {"folder": str(folder), "ok": not faults, "faults": faults, **({"repaired": mended} if repair else {})}
        sys.stdout.write(json.dumps(found, indent=1) + "\n")
    else:
        for file in mended:
            console.print(f"{file}: simulated again", markup=False)
        console.print("\n".join(faults) if faults else f"{folder}: every shard is as the manifest says", markup=False)
    return FAULT if faults else OK


@app.command
def merge(folders: Annotated[list[Path], Parameter(consume_multiple=True, negative=())], /, *, out: Path) -> int:
    """Join datasets of one system, made from different root seeds, into a new one.

    Parameters
    ----------
    folders
        Dataset folders, at least two.
    out
        Folder of the joint dataset; must not exist.
    """
    from datagen import merge as merge_

    manifest = merge_(folders, out)
    console.print(f"{len(manifest.done())} systems in {out}", markup=False)
    return OK


@app.command
def identifiability(
    system: Path,
    *,
    context: Annotated[list[float] | None, Parameter(consume_multiple=True, negative=())] = None,
    noise: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None,
    channels: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None,
    systems: int = 10,
    seed: int = 1,
    workers: int = 2,
    out: Path | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """The limit of R2 that any estimator can reach, per parameter, from the FMU's sensitivities.

    The result is kept beside the system description, from where `datagen run` copies it into datasets.

    Parameters
    ----------
    system
        System description (TOML), or its folder.
    context
        Lengths of the recording [h]; by default the estimator's.
    noise
        Noise presets of the description; `none` is the numerical floor.
    channels
        Outputs that are measured, separated by commas; several sets one after another. By default the estimator's.
    systems
        Random systems and windows to average over.
    seed
        Root seed of these systems.
    workers
        Processes.
    out
        File to keep the result in, in place of `identifiability.json` beside the description.
    as_json
        Print JSON.
    """
    from datagen.ceilings import ceilings_of
    from datagen.fmu import fmu_sha256
    from shared.ceiling import FILE_NAME, Ceilings, read_ceilings, write_ceilings
    from shared.system import load_system

    described = load_system(system)
    sets = [one.split(",") for one in channels] if channels else [described.estimator.channels]
    found = ceilings_of(
        described,
        contexts=context or [described.estimator.context_hours],
        conditions=[(preset, names) for names in sets for preset in noise or ["none"]],
        systems=systems,
        seed=seed,
        workers=workers,
    )
    path = out or described.path.parent / FILE_NAME
    kept = Ceilings(
        system_name=described.name,
        system_hash=described.hash(),
        fmu_sha256=fmu_sha256(described.fmu_path),
        outputs=described.output_names,
        nuisances=[one.name for one in described.inputs if one.source == "occupancy"],
    )
    if path.exists():
        before = read_ceilings(path)
        if (before.system_hash, before.fmu_sha256) == (kept.system_hash, kept.fmu_sha256):
            kept = before
    for one in found:
        kept.put(one)
    write_ceilings(path, kept)
    if as_json:
        sys.stdout.write(json.dumps([one.model_dump() for one in found], indent=1) + "\n")
        return OK
    console.print(f"Limit of R2 of any estimator, mean of {systems} systems", markup=False)
    for first in range(0, len(found), 3):  # three conditions side by side fit a terminal
        some = found[first : first + 3]
        heads = [f"{one.context_hours:g} h, {one.noise}\n{' '.join(one.channels)}" for one in some]
        table = Table("parameter", *heads, box=None)
        for name in described.parameter_names:
            table.add_row(name, *(f"{one.r2[name]:.3f}" for one in some))
        means = (f"{one.r2_mean:.3f} [{one.r2_mean_low:.3f}, {one.r2_mean_high:.3f}]" for one in some)
        table.add_row("mean", *means)
        console.print(table)
    console.print(f"kept in {path}", markup=False)
    return OK


def _options(words: list[str]) -> dict[str, str]:
    pairs = [word.partition("=") for word in words]
    for name, sign, _ in pairs:
        if not sign:
            raise ZeroshotError(f"--cluster-option {name!r}; expected NAME=VALUE")
    return {name: value for name, _, value in pairs}


def main() -> None:
    """Entry point of the console script."""
    raise SystemExit(start(app))


if __name__ == "__main__":
    main()
