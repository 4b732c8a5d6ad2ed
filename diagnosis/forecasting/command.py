"""The command ``diagnosis forecast``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from diagnosis.scores import score_table
from shared.console import OK, new_console
from shared.logs import USUAL, Reporting
from shared.progress import stages

console = new_console()


def forecast(
    system: Path,
    recording: Path,
    *,
    out: Path,
    context: float = 168.0,
    ahead: float = 336.0,
    run: Path | None = None,
    calibration: Path | None = None,
    replay: bool = False,
    occupancy: Literal["measured", "unknown"] | None = None,
    noise: str = "sensor",
    starts: int = 3,
    workers: int = 1,
    scheduler: str | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    report: Reporting = USUAL,
) -> int:
    """Estimate parameters from a recording's first days, simulate the days after, and compare.

    Writes forecast.json and forecast.html. Ahead, the recording's inputs drive the model.

    Parameters
    ----------
    system
        System description (TOML), or its folder.
    recording
        The recording (NetCDF), as long as context and forecast together.
    out
        Folder for the results.
    context
        What the parameters are estimated from [h].
    ahead
        What is forecast [h].
    run
        Folder of an estimator for the first guess.
    calibration
        A folder of `diagnosis calibrate`, in place of one on the context.
    replay
        The recorded actuators replace the model's control loops.
    occupancy
        Whether persons were counted; without this, they were if the recording has them.
    noise
        Noise preset of the description.
    starts
        Starts of the calibration.
    workers
        Processes that simulate side by side.
    scheduler
        Address of a Dask scheduler, to simulate on its workers.
    as_json
        Print JSON.
    """
    from diagnosis.forecasting.forecast import forecast as forecast_

    with stages("simulating", shown=not report.quiet):
        done = forecast_(
            system,
            recording,
            context=context,
            ahead=ahead,
            run=run,
            calibration=calibration,
            out=out,
            replay=replay,
            occupancy=occupancy,
            noise=noise,
            starts=starts,
            workers=workers,
            scheduler=scheduler,
        )
    if as_json:
        sys.stdout.write(done.report.model_dump_json(indent=1) + "\n")
        return OK
    console.print(score_table({name: one for name, one in done.report.outputs.items() if one is not None}))
    console.print(f"{out / 'forecast.html'}")
    return OK
