"""The command ``diagnosis``: thin shells over the functions of the same names."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from diagnosis.app.server import app as app_
from diagnosis.blind.command import app as blind
from diagnosis.calibrating.command import calibrate
from diagnosis.farming.command import farm
from diagnosis.forecasting.command import forecast
from diagnosis.gap.command import run as run_
from diagnosis.measurements.command import import_
from diagnosis.usual import WARM_UP
from shared.assignments import assignments
from shared.console import OK, new_app, new_console, start
from shared.stretches import LONGEST, Stretch
from shared.watchdog import PATIENT, Patience

app = new_app(
    "diagnosis",
    "Compare a recording of a building with its simulation model.\n\n"
    "A recording is a NetCDF file with the outputs and inputs that the system description names.",
)
console = new_console()


@app.command
def residuals(
    system: Path,
    recording: Path,
    *,
    run: Path | None = None,
    calibration: Path | None = None,
    set_: Annotated[list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())] = None,
    replay: bool = False,
    noise: str | None = None,
    warm_up: float = WARM_UP,
    stretch: Stretch = LONGEST,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    patience: Patience = PATIENT,
) -> int:
    """Simulate a recording with given, estimated or calibrated parameters, and print the residuals.

    Parameters
    ----------
    system
        System description (TOML), its folder, or the name of one that comes with the package.
    recording
        The recording (NetCDF).
    run
        Folder of an estimator. Its estimate is used for parameters that are not set.
    calibration
        Folder of a `diagnosis calibrate`, of this recording or another: use its parameters, constants and noise, in
        place of --run, --set and --noise. Unknown occupancy and initial states are then the most likely ones.
    set_
        Parameter values as NAME=VALUE.
    replay
        Drive the model with the recorded actuators in place of its control loops.
    noise
        Noise preset of the description, to remove noise from replayed actuators. Default: `sensor`.
    warm_up
        Repeat the recording's first day for so long before its start [h].
    as_json
        Print JSON.
    """
    from diagnosis import residuals as residuals_

    values = assignments(set_ or [])
    found = residuals_(
        system,
        recording,
        run=run,
        calibration=calibration,
        parameters=values,
        replay=replay,
        stretch=stretch,
        noise=noise,
        warm_up=warm_up,
    )
    if as_json:
        sys.stdout.write(json.dumps(found.to_json(), indent=1, allow_nan=False) + "\n")
        return OK
    table = Table("output", "unit", "RMSE", "bias", "CVRMSE", "NMBE", "lag-1 autocorrelation", box=None)
    for name, one in found.outputs.items():
        table.add_row(
            f"{name} (replayed)" if name in found.replayed else name,
            one["unit"],
            f"{one['rmse']:.4g}",
            f"{one['bias']:.4g}",
            "-" if one["cvrmse"] is None else f"{one['cvrmse']:.2%}",
            "-" if one["nmbe"] is None else f"{one['nmbe']:.2%}",
            "-" if one["autocorrelation"] is None else f"{one['autocorrelation']:.2f}",
        )
    console.print(table)
    if found.assumed:
        taken = "; ".join(f"{name} = {what}" for name, what in found.assumed.items())
        console.print(f"Not measured, and taken as: {taken}.", markup=False)
    if any(name in found.outputs for name in found.replayed):
        said = "Replayed outputs drive the model, so their rows say nothing about it."
        console.print(said, markup=False)
    return OK


app.command(import_, name="import")
app.command(calibrate)
app.command(forecast)
app.command(run_, name="run")
app.command(farm)
app.command(app_, name="app")
app.command(blind)


def main() -> None:
    """Entry point of the console script."""
    raise SystemExit(start(app))


if __name__ == "__main__":
    main()
