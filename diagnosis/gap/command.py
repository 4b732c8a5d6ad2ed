"""The command ``diagnosis run``: a thin shell over :func:`diagnosis.gap.diagnose`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.table import Table

from shared.console import OK, new_console
from shared.logs import USUAL, Reporting
from shared.progress import stages

console = new_console()


def run(
    system: Path,
    recording: Path,
    *,
    out: Path,
    run_: Annotated[Path | None, Parameter(name="--run")] = None,
    replay: bool = False,
    occupancy: Literal["measured", "unknown"] | None = None,
    noise: str = "sensor",
    warm_up: float = 240.0,
    workers: int = 1,
    scheduler: str | None = None,
    seed: int = 0,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    reporting: Reporting = USUAL,
) -> int:
    """Diagnose the gap between a recording and the model: where it lies, which effect causes it, how far it shrinks.

    Writes report.html and report.json.

    Parameters
    ----------
    system
        System description (TOML), or its folder.
    recording
        The recording (NetCDF).
    out
        Folder for the results.
    run_
        Folder of an estimator, whose estimate is the first start; without one, the middle of the prior is.
    replay
        The recorded actuators replace the model's control loops.
    occupancy
        Whether persons were counted; without this, they were if the recording has them.
    noise
        Noise preset of the description.
    warm_up
        The recording's first day is repeated this long before its start [h].
    workers
        Processes that simulate side by side.
    scheduler
        Address of a Dask scheduler, to simulate on its workers.
    seed
        Of twins, placebos and bootstraps.
    as_json
        Print the report as JSON.
    """
    from diagnosis.gap.diagnosed import diagnose

    with stages("reading", shown=not reporting.quiet) as tell:
        report = diagnose(
            system,
            recording,
            run=run_,
            out=out,
            replay=replay,
            occupancy=occupancy,
            noise=noise,
            warm_up=warm_up,
            workers=workers,
            scheduler=scheduler,
            seed=seed,
            tell=tell,
        ).report
    if as_json:
        sys.stdout.write(report.model_dump_json(indent=1) + "\n")
        return OK
    for sentence in report.summary:
        console.print(sentence, markup=False)
    table = Table("candidate", "probability", "size", "unit", box=None)
    for one in report.effects[:5]:
        if one.probability >= 0.005:
            size = "" if one.amplitude is None else f"{one.amplitude:.3g}"
            table.add_row(one.name, f"{one.probability:.0%}", size, one.unit)
    table.add_row("none of these", f"{report.none_of_these:.0%}", "", "")
    table.add_row("no gap", f"{report.no_gap:.0%}", "", "")
    console.print(table)
    console.print(report.limits[0], style="yellow")
    console.print(f"{report.simulations} simulations, {report.seconds:.0f} s; {out / 'report.html'}")
    return OK
