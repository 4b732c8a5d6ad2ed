"""The command ``diagnosis``: thin shells over the functions of the same names."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.table import Table

from diagnosis.blind.command import app as blind
from diagnosis.gap.command import run as run_
from diagnosis.importing.command import import_
from shared.assignments import assignments
from shared.console import OK, errors, new_app, new_console, start

app = new_app(
    "diagnosis",
    "Hold a recording of a building against its simulation model.\n\n"
    "A recording is a NetCDF file with the outputs and inputs that the system description names.",
)
console = new_console()


@app.command
def residuals(
    system: Path,
    recording: Path,
    *,
    run: Path | None = None,
    set_: Annotated[list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())] = None,
    replay: bool = False,
    warm_up: float = 240.0,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Simulate a recording's inputs with given or estimated parameters, and say what is left.

    Parameters
    ----------
    system
        System description (TOML), or its folder.
    recording
        The recording (NetCDF).
    run
        Folder of an estimator, whose estimate is used for parameters that are not set.
    set_
        Parameter values as NAME=VALUE.
    replay
        The recorded actuators replace the model's control loops.
    warm_up
        The recording's first day is repeated this long before its start [h].
    as_json
        Print JSON.
    """
    from diagnosis import residuals as residuals_

    found = residuals_(system, recording, run=run, parameters=assignments(set_ or []), replay=replay, warm_up=warm_up)
    if as_json:
        sys.stdout.write(json.dumps(found, indent=1) + "\n")
        return OK
    table = Table("output", "unit", "RMSE", "bias", "CVRMSE", "NMBE", "lag-1 autocorrelation", box=None)
    for name, one in found["outputs"].items():
        table.add_row(
            name,
            one["unit"],
            f"{one['rmse']:.4g}",
            f"{one['bias']:.4g}",
            "-" if one["cvrmse"] is None else f"{one['cvrmse']:.2%}",
            "-" if one["nmbe"] is None else f"{one['nmbe']:.2%}",
            f"{one['autocorrelation']:.2f}",
        )
    console.print(table)
    return OK


@app.command
def calibrate(
    system: Path,
    recording: Path,
    *,
    out: Path,
    run: Path | None = None,
    replay: bool = False,
    occupancy: Literal["measured", "unknown"] | None = None,
    noise: str = "sensor",
    starts: int = 3,
    warm_up: float = 240.0,
    workers: int = 1,
    scheduler: str | None = None,
    seed: int = 0,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
) -> int:
    """Estimate a system's parameters from a recording: zero-shot first, then by simulation.

    Writes calibration.json and calibration.html: parameters with their uncertainty, what the recording tells and what
    not, the fit, and what is left.

    Parameters
    ----------
    system
        System description (TOML), or its folder.
    recording
        The recording (NetCDF).
    out
        Folder for the results.
    run
        Folder of an estimator, whose estimate is the first start; without one, the middle of the prior is.
    replay
        The recorded actuators replace the model's control loops.
    occupancy
        Whether persons were counted; without this, they were if the recording has them.
    noise
        Noise preset of the description.
    starts
        Starts in all; further ones are drawn from the prior.
    warm_up
        The recording's first day is repeated this long before its start [h].
    workers
        Processes that simulate side by side.
    scheduler
        Address of a Dask scheduler, to simulate on its workers.
    seed
        Of the further starts.
    as_json
        Print JSON.
    """
    from diagnosis.calibration import calibrate as calibrate_
    from diagnosis.calibration_report import summary

    with errors.status("simulating", spinner="dots"):
        done = calibrate_(
            system,
            recording,
            run=run,
            out=out,
            replay=replay,
            occupancy=occupancy,
            noise=noise,
            starts=starts,
            warm_up=warm_up,
            workers=workers,
            scheduler=scheduler,
            seed=seed,
        )
    if as_json:
        sys.stdout.write(done.report.model_dump_json(indent=1) + "\n")
        return OK
    table = Table("parameter", "unit", "value", "90 % interval", "told", "", box=None)
    for one in done.report.parameters:
        note = "on its bound" if one.at_bound else one.identified
        table.add_row(
            one.name, one.unit, f"{one.value:.4g}", f"{one.low:.4g} to {one.high:.4g}", f"{one.told:.0%}", note
        )
    console.print(table)
    console.print(_scores(done.report.outputs))
    for sentence in summary(done):
        console.print(sentence, markup=False)
    console.print(f"{done.report.simulations} simulations, {done.report.seconds:.0f} s; {out / 'calibration.html'}")
    return OK


@app.command
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
    from diagnosis.forecasting import forecast as forecast_

    with errors.status("simulating", spinner="dots"):
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
    console.print(_scores({name: one for name, one in done.report.outputs.items() if one is not None}))
    console.print(f"{out / 'forecast.html'}")
    return OK


def _scores(outputs: Mapping[str, Any]) -> Table:
    """Scores by output."""
    table = Table("output", "unit", "RMSE", "bias", "CVRMSE", "NMBE", "shares of", box=None)
    for name, one in outputs.items():
        shares = ["-" if value is None else f"{value:.2%}" for value in (one.cvrmse, one.nmbe)]
        table.add_row(name, one.unit, f"{one.rmse:.4g}", f"{one.bias:.4g}", *shares, one.share_of)
    return table


app.command(import_, name="import")
app.command(run_, name="run")
app.command(blind)


def main() -> None:
    """Entry point of the console script."""
    raise SystemExit(start(app))


if __name__ == "__main__":
    main()
