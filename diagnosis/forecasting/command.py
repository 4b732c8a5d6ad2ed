"""The command ``diagnosis forecast``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from diagnosis.options import PLAIN, Fitting
from diagnosis.scores import score_table
from shared.console import OK, Place, Positive, new_console, resumable
from shared.logs import USUAL, Reporting
from shared.progress import stages
from shared.stretches import LONGEST, Stretch
from shared.watchdog import PATIENT, Patience

console = new_console()


@resumable()
def forecast(
    system: Path,
    recording: Path,
    *,
    out: Place,
    context: float = 168.0,
    ahead: float = 336.0,
    calibration: Path | None = None,
    starts: Positive | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    stretch: Stretch = LONGEST,
    fitting: Fitting = PLAIN,
    patience: Patience = PATIENT,
    report: Reporting = USUAL,
) -> int:
    """Estimate parameters from a recording's first days, simulate the days after, and compare.

    Writes forecast.json and forecast.html. The recording's inputs drive the model in the days ahead.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    recording
        The recording (NetCDF), as long as context and forecast together.
    out
        Folder for the results.
    context
        Length of the first part, from which the parameters are estimated [h].
    ahead
        Length of the forecast [h].
    calibration
        Folder of a `diagnosis calibrate`, in place of a calibration on the context. Not with --run, --starts or
        --noise.
    starts
        Start points of the calibration on the context. Default: as `diagnosis calibrate`.
    as_json
        Print JSON.
    """
    from diagnosis.calibrating.report import sentences
    from diagnosis.forecasting.forecast import forecast as forecast_
    from diagnosis.forecasting.report import answer
    from diagnosis.physics import hints, warnings

    with stages("diagnosis", "reading", shown=not report.quiet):
        done = forecast_(
            system,
            recording,
            context=context,
            ahead=ahead,
            calibration=calibration,
            out=out,
            stretch=stretch,
            **fitting.given,
            starts=starts,
        )
    if as_json:
        sys.stdout.write(done.report.model_dump_json(indent=1) + "\n")
        return OK
    for sentence in warnings(done.report.physics):
        console.print(sentence, style="bold red", markup=False)
    scored = {name: one for name, one in done.report.outputs.items() if one is not None}
    console.print(score_table(scored, within_the_band={name: one.covered for name, one in scored.items()}))
    names = {one.name: one.long_name for one in done.system.outputs}
    for sentence in answer(done.report, names) + sentences(done.report.calibration) + hints(done.report.physics):
        console.print(sentence, markup=False)
    console.print(f"{out / 'forecast.html'}")
    return OK
