"""The command ``diagnosis calibrate``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from diagnosis.options import PLAIN, Fitting
from diagnosis.scores import score_table
from diagnosis.usual import STARTS, WARM_UP
from shared.console import OK, NotNegative, Place, Positive, new_console, resumable
from shared.logs import USUAL, Reporting
from shared.progress import stages
from shared.stretches import LONGEST, Stretch
from shared.watchdog import PATIENT, Patience

console = new_console()


@resumable()
def calibrate(
    system: Path,
    recording: Path,
    *,
    out: Place,
    starts: Positive = STARTS,
    warm_up: float = WARM_UP,
    seed: NotNegative = 0,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    stretch: Stretch = LONGEST,
    fitting: Fitting = PLAIN,
    patience: Patience = PATIENT,
    report: Reporting = USUAL,
) -> int:
    """Estimate a system's parameters from a recording by simulation, from a zero-shot estimate (--run) or the prior.

    Writes calibration.json and calibration.html: parameters with intervals, how well the recording identifies them, the
    fit, and the residuals.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    recording
        The recording (NetCDF).
    out
        Folder for the results.
    starts
        Number of start points. Those after the first are drawn from the prior.
    warm_up
        Repeat the recording's first day for so long before its start [h], at least a step.
    seed
        Seed of the further start points.
    as_json
        Print JSON.
    """
    from diagnosis.calibrating.calibration import calibrate as calibrate_
    from diagnosis.calibrating.report import sentences
    from diagnosis.physics import hints, warnings

    with stages("diagnosis", "reading", shown=not report.quiet):
        done = calibrate_(
            system,
            recording,
            out=out,
            stretch=stretch,
            **fitting.given,
            starts=starts,
            warm_up=warm_up,
            seed=seed,
        )
    if as_json:
        sys.stdout.write(done.report.model_dump_json(indent=1) + "\n")
        return OK
    for sentence in warnings(done.report.physics):
        console.print(sentence, style="bold red", markup=False)
    table = Table("parameter", "unit", "value", "90 % interval", "identified", "", box=None)
    for one in done.report.parameters:
        note = "on its bound" if one.at_bound else one.identified
        table.add_row(
            one.name, one.unit, f"{one.value:.4g}", f"{one.low:.4g} to {one.high:.4g}", f"{one.told:.0%}", note
        )
    console.print(table)
    outputs = done.report.outputs
    console.print(score_table({name if one.used else f"{name} (replayed)": one for name, one in outputs.items()}))
    for sentence in sentences(done.report) + hints(done.report.physics):
        console.print(sentence, markup=False)
    console.print(f"{done.report.simulations} simulations, {done.report.seconds:.0f} s; {out / 'calibration.html'}")
    return OK
