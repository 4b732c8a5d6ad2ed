"""The command ``diagnosis farm``: a thin shell over :func:`diagnosis.farming.farm.farm`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from shared.console import OK, PARTLY, NotNegative, Place, Positive, new_console, resumable
from shared.logs import USUAL, Reporting
from shared.numbers import counted
from shared.progress import progress_bar
from shared.watchdog import PATIENT, Patience

console = new_console()


@resumable()
def farm(
    system: Path,
    *,
    out: Place,
    recordings: Positive = 400,
    seed: NotNegative | None = None,
    hours: float = 168.0,
    noise: str = "sensor",
    workers: Positive | None = None,
    scheduler: str | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    patience: Patience = PATIENT,
    report: Reporting = USUAL,
) -> int:
    """Calibrate what `diagnosis run` says of a system, by recordings whose cause is known.

    Makes the recordings, diagnoses each, and writes verdict.json: put it beside the system's description. Two cores
    make about 60 recordings of a week in an hour. The same command goes on from where it stopped. The exit code is 3
    where recordings failed or are too few.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    out
        Folder for verdict.json and what it is made of.
    recordings
        How many in all; more can be asked for later.
    seed
        Decides all. Default: drawn, or that of the folder.
    hours
        Length of each recording [h], at least a day.
    noise
        Noise preset of the description.
    workers
        Processes on this machine. Default: one a core.
    scheduler
        Address of a Dask scheduler that runs already, in place of --workers.
    as_json
        Print verdict.json.
    """
    from diagnosis.farming.farm import farm as farm_

    with progress_bar("recordings", recordings, shown=not report.quiet) as bar:
        done = farm_(
            system,
            out,
            recordings=recordings,
            seed=seed,
            hours=hours,
            noise=noise,
            workers=workers,
            scheduler=scheduler,
            progress=lambda count, _: bar.update(count),
        )
    code = PARTLY if done.failed or done.verdicts is None else OK
    if as_json:
        found = {} if done.verdicts is None else done.verdicts.model_dump(mode="json")
        sys.stdout.write(json.dumps(found, indent=1, allow_nan=False) + "\n")
        return code
    console.print(done.headline, markup=False, soft_wrap=True)
    if done.failed:
        index, why = next(iter(done.failed.items()))
        said = f"{counted(len(done.failed), 'recording')} failed; recording {index}: {why}"
        console.print(said, style="yellow", markup=False, soft_wrap=True)
    if done.verdicts is None:
        return code
    table = Table("answers", "number", "said", "true", box=None)
    answers = done.verdicts.answers
    for one in [answers.alarms, answers.named, answers.outside, *done.verdicts.reliability]:
        what = one.what if one.high - one.low == 1 else f"{one.what}, said to be {one.low:.0%} to {one.high:.0%} sure"
        table.add_row(what, str(one.count), f"{one.said:.0%}" if one.said else "", f"{one.true:.0%}")
    console.print(table)
    console.print(f"{out / 'verdict.json'}: put it beside {system}'s description.", markup=False, soft_wrap=True)
    return code
