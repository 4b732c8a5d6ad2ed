"""The command ``diagnosis run``: a thin shell over :func:`diagnosis.gap.diagnose`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from diagnosis.options import PLAIN, Fitting
from diagnosis.usual import WARM_UP
from shared.console import OK, NotNegative, Place, new_console, resumable
from shared.logs import USUAL, Reporting
from shared.numbers import chance, counted, number
from shared.progress import stages
from shared.stretches import LONGEST, Stretch
from shared.watchdog import PATIENT, Patience

console = new_console()
LINES = 5
"""So many candidates are printed; the report has all."""


@resumable()
def run(
    system: Path,
    recording: Path,
    *,
    out: Place,
    warm_up: float = WARM_UP,
    seed: NotNegative = 0,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    stretch: Stretch = LONGEST,
    fitting: Fitting = PLAIN,
    patience: Patience = PATIENT,
    reporting: Reporting = USUAL,
) -> int:
    """Diagnose the gap between a recording and the model: where it lies, which effect causes it, how far it shrinks.

    Writes report.html and report.json.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    recording
        The recording (NetCDF).
    out
        Folder for the results.
    warm_up
        Repeat the recording's first day for so long before its start [h], at least a step.
    seed
        Seed of bootstrap replicates and placebos.
    as_json
        Print the report as JSON.
    """
    from diagnosis.gap.diagnosed import diagnose
    from diagnosis.gap.sentences import headline
    from diagnosis.physics import hints, warnings

    with stages("diagnosis", "reading", shown=not reporting.quiet):
        report = diagnose(
            system,
            recording,
            out=out,
            stretch=stretch,
            **fitting.given,
            warm_up=warm_up,
            seed=seed,
        ).report
    if as_json:
        sys.stdout.write(report.model_dump_json(indent=1) + "\n")
        return OK
    for sentence in warnings(report.physics):
        console.print(sentence, style="bold red", markup=False)
    console.print(headline(report), style="bold", markup=False)
    for sentence in report.summary + hints(report.physics):
        console.print(sentence, markup=False)
    table = Table("candidate", "probability", "size", "unit", box=None)
    told = report.foremost[:LINES]
    for one in told:
        size = "" if one.amplitude is None else number(one.amplitude, 3)
        table.add_row(one.name, chance(one.probability), size, one.unit)
    if others := [one.probability for one in report.effects if one not in told]:
        table.add_row(counted(len(others), "other"), chance(sum(others)), "", "")
    for name in report.failed:
        table.add_row(name, "failed", "", "")
    if report.untried:
        table.add_row("one that was not tried", chance(report.untried), "", "")
    table.add_row("none of these", chance(report.none_of_these), "", "")
    table.add_row("no gap", chance(report.no_gap), "", "")
    console.print(table)
    for name, why in report.failed.items():
        console.print(f"{name} failed: {why}.", style="yellow")
    for sentence in report.limits[: 2 if report.unfinished else 1]:
        console.print(sentence, style="yellow")
    console.print(f"{report.simulations} simulations, {report.seconds:.0f} s; {out / 'report.html'}")
    return OK
