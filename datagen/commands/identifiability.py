"""The command ``datagen identifiability``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from rich.table import Table
from rich.text import Text

from shared.console import OK, NotNegative, Place, Positive, new_console
from shared.errors import ZeroshotError
from shared.logs import USUAL, Reporting, logger
from shared.watchdog import PATIENT, Patience

if TYPE_CHECKING:
    from datagen.limits.exact import Reachable
    from shared.ceiling import Ceiling

console = new_console()
_log = logger(__name__)


def identifiability(
    system: Path,
    *,
    context: Annotated[list[float] | None, Parameter(consume_multiple=True, negative=())] = None,
    noise: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None,
    channels: Annotated[list[str] | None, Parameter(consume_multiple=True, negative=())] = None,
    preset: str | None = None,
    systems: Positive = 10,
    seed: NotNegative = 1,
    workers: Positive = 2,
    uncertain: Annotated[bool, Parameter(negative=())] = False,
    exact: Annotated[bool, Parameter(negative=())] = False,
    steps: Positive = 2000,
    out: Place | None = None,
    overwrite: Annotated[bool, Parameter(negative=())] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    patience: Patience = PATIENT,
    report: Reporting = USUAL,
) -> int:
    """Print the ceiling of R2 for each parameter: the linearised limit from the FMU's sensitivities, or the reachable.

    The result is written beside the system description, from where `datagen run` copies it into datasets. A parameter
    that the FMU accepts but ignores is refused.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    context
        Lengths of the recording [h]; by default the estimator's.
    noise
        Noise presets of the description; by default `none` alone, the numerical floor, which no sensor reaches.
    channels
        Outputs that are measured: names of one set separated by commas, several sets by spaces, as in
        `--channels FIRST,SECOND FIRST,SECOND,THIRD`. An occupancy input among them means that occupants are
        counted. By default the estimator's.
    preset
        Use records of this preset of the description: its season, length and step.
    systems
        Random systems and windows to average over.
    seed
        Root seed of these systems.
    workers
        Processes.
    uncertain
        Draw the description's [[uncertain]] constants for each system, and treat them as unknown: the ceiling for
        datasets of `datagen run --uncertain`.
    exact
        Print the reachable ceiling, beside the linearised one of the same rooms: chains visit each room's posterior
        with the real simulator and with occupants as they are drawn. It takes minutes for each room and condition, in
        one process. Rooms are kept in the folder `--out` as they are done, and a second run goes on from there.
    steps
        Simulations of each chain of `--exact`.
    out
        File for the result, in place of `identifiability.json` beside the description; with `--exact` a folder for
        its rooms. Required with the name of a shipped system, and with `--exact`. Other conditions in the file are
        kept.
    overwrite
        Replace a file of another system, of an earlier description or FMU, and ceilings of more systems.
    as_json
        Print JSON.
    """
    if exact and out is None:
        raise ZeroshotError("--exact: has no --out; expected a folder to keep its rooms in")
    from datagen.fmi.checking import check_system, fmu_of
    from datagen.limits.ceilings import ceilings_of, check_conditions
    from datagen.limits.exact import reachable_ceilings
    from datagen.limits.keeping import ceilings_at, check_as_many
    from datagen.simulating.liveness import HARDLY, check_live_apart
    from shared.ceiling import FILE_NAME, in_words, write_ceilings
    from shared.system import load_system

    described = load_system(system)
    if out is None and not system.exists():
        raise ZeroshotError(
            f"{system}: comes with the package, and so do its limits ({described.path.parent / FILE_NAME}); expected"
            " --out with a file for these, or the path of your own description"
        )
    if preset is not None:
        chosen = described.preset(preset)
        described = described.with_experiment(hours=chosen.hours, step=chosen.step, start=chosen.start)
    path = described.path.parent / FILE_NAME if out is None else out
    contexts = [described.estimator.context_hours] if context is None else context
    sets = [described.estimator.channels] if channels is None else [one.split(",") for one in channels]
    conditions = [(one, names) for names in sets for one in (["none"] if noise is None else noise)]
    if len(sets) > 1 and all(len(names) == 1 for names in sets):
        together = ",".join(name for names in sets for name in names)
        _log.info("%d sets of one channel each; %s would be one set of all", len(sets), together)
    check_conditions(described, contexts, conditions, systems=systems, uncertain=uncertain)
    if exact:
        check_system(described, fmu_of(described))
        reachable = reachable_ceilings(
            described,
            path,
            contexts=contexts,
            conditions=conditions,
            systems=systems,
            seed=seed,
            steps=steps,
            uncertain=uncertain,
            quiet=report.quiet,
        )
        if as_json:
            sys.stdout.write(json.dumps([one.model_dump() for one in reachable], indent=1, allow_nan=False) + "\n")
        for condition in [] if as_json else reachable:
            _print_reachable(condition)
        return OK
    before = ceilings_at(path, described, overwrite=overwrite)
    if not overwrite:
        check_as_many(path, before, described, contexts, conditions, systems=systems, uncertain=uncertain)
    check_system(described, fmu_of(described))  # sooner than in a process apart
    check_live_apart(described, least=HARDLY)  # how weak a parameter is, is the question here
    found = ceilings_of(
        described,
        contexts=contexts,
        conditions=conditions,
        systems=systems,
        seed=seed,
        workers=workers,
        uncertain=uncertain,
        quiet=report.quiet,
    )
    kept = ceilings_at(path, described, overwrite=overwrite)  # another run may have added to it meanwhile
    for one in found:
        kept.put(one)
    write_ceilings(path, kept)
    if as_json:
        sys.stdout.write(json.dumps([one.model_dump() for one in found], indent=1, allow_nan=False) + "\n")
        return OK
    how = f", {in_words(found[0].constants)}" if uncertain else ""
    console.print(f"Linearised limit of R2, mean of {systems} systems{how}", markup=False)
    for first in range(0, len(found), 3):  # three conditions side by side fit a terminal
        some = found[first : first + 3]
        heads = [f"{one.context_hours:g} h, {one.noise}\n{' '.join(one.channels)}" for one in some]
        table = Table("parameter", *heads, box=None)
        for name in described.parameter_names:
            table.add_row(name, *(f"{one.r2[name]:.3f}" for one in some))
        table.add_row("mean", *(f"{one.r2_mean:.3f}{_interval(one)}" for one in some))
        console.print(table)
    if systems == 1:
        console.print("of one system there is no interval", markup=False)
    console.print(f"kept in {path}", markup=False)
    return OK


def _print_reachable(one: Reachable) -> None:
    low, high = one.acceptance
    what = f"{one.context_hours:g} h, {one.noise}, {' '.join(one.channels)}"
    console.print(f"R2 in {one.rooms} rooms, {what}; acceptance {low:.2f} to {high:.2f}", markup=False)
    table = Table("parameter", "reachable ceiling", "linearised", "posterior means", "effective draws", box=None)
    rows = zip(one.parameters, one.r2, one.low, one.high, one.linearised, one.scored, one.effective, strict=True)
    for name, r2, low_, high_, linearised, scored, effective in rows:
        value = "" if r2 is None else f"{r2:.3f}"
        value += "" if low_ is None or high_ is None else f" [{low_:.3f}, {high_:.3f}]"
        table.add_row(name, Text(value), f"{linearised:.3f}", f"{scored:.3f}", f"{effective:.0f}")
    console.print(table)
    if None in one.r2:
        said = "Empty: chains of so few effective draws say too little; more --steps help."
        console.print(said, markup=False)


def _interval(one: Ceiling) -> str:
    if one.r2_mean_low is None or one.r2_mean_high is None:
        return ""
    return f" [{one.r2_mean_low:.3f}, {one.r2_mean_high:.3f}]"
