"""The command ``datagen compare``: a thin shell over :func:`datagen.comparing.comparison.compare`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from shared.console import OK, NotNegative, Place, Positive, new_console
from shared.logs import USUAL, Reporting
from shared.numbers import number
from shared.watchdog import PATIENT, Patience

console = new_console()


def compare(
    first: Path,
    second: Path | None = None,
    /,
    *,
    recorded: Path | None = None,
    data: Path | None = None,
    systems: Positive = 5,
    seed: NotNegative | None = None,
    hours: float | None = None,
    step: float | None = None,
    excitation: bool = True,
    out: Place | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    patience: Patience = PATIENT,
    report: Reporting = USUAL,
) -> int:
    """Compare two models of one system: by time of year, by regime, by system.

    The second model is another description, with another FMU, or `--recorded` trajectories of another tool. Both get
    the same parameters, weather and occupancy, as far as both have them. A warning and the report name what only one
    has. A value under [fixed] of the second description is used there in place of the first's, with a warning.
    Differences are second minus first.

    Parameters
    ----------
    first
        System description (TOML), its folder, or the name of one that comes with the package: it says what is
        simulated.
    second
        Description of the other model.
    recorded
        In place of the second model: a TOML that maps the columns of CSV files to the description's variables.
    data
        Folder of those CSV files; by default the TOML's.
    systems
        Number of random systems, or the largest number of recorded ones.
    seed
        Root seed, 0 by default. --seed, --hours, --step and --no-excitation do not go with `--recorded`.
    hours
        Length of each record [h]; by default the first description's.
    step
        Output step [s]; by default the first description's.
    excitation
        Add the description's small sinusoids to the control actions.
    out
        Folder for the table (Markdown, CSV) and the picture.
    as_json
        Print JSON.
    """
    from datagen.comparing.comparison import compare as compare_
    from datagen.comparing.report import check_report, write_report

    if out is not None:
        check_report(out)
    found = compare_(
        first,
        second,
        recorded=recorded,
        data=data,
        systems=systems,
        seed=seed,
        hours=hours,
        step=step,
        excitation=excitation,
        quiet=report.quiet,
    )
    written = write_report(found, out) if out is not None else []
    if as_json:
        sys.stdout.write(json.dumps(found.records(), indent=1, allow_nan=False) + "\n")
        return OK
    console.print(f"{found.names[1]} minus {found.names[0]}: rms (bias)", markup=False)
    table = Table("", "", "steps", *(f"{one.name} [{one.unit}]" for one in found.outputs), box=None)
    for row in found.rows():
        pairs = zip(row.rms, row.bias, strict=True)
        figures = (f"{number(rms, 3)} ({number(bias, 3, signed=True)})" for rms, bias in pairs)
        table.add_row(row.group, row.cell, str(row.steps), *figures)
    console.print(table)
    for path in written:
        console.print(f"written: {path}", markup=False)
    return OK
