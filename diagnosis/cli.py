"""The command ``diagnosis``: thin shells over the functions of the same names."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from rich.table import Table

from diagnosis.app.server import app as app_
from diagnosis.blind.command import app as blind
from diagnosis.measurements.command import import_
from diagnosis.scores import score_table
from diagnosis.usual import STARTS, WARM_UP
from shared.assignments import assignments
from shared.console import OK, PARTLY, NotNegative, Place, Positive, new_app, new_console, resumable, start
from shared.logs import USUAL, Reporting
from shared.numbers import chance, counted, number
from shared.progress import progress_bar, stages
from shared.stretches import LONGEST, Stretch
from shared.watchdog import PATIENT, Patience

app = new_app(
    "diagnosis",
    "Compare a recording of a building with its simulation model.\n\n"
    "A recording is a NetCDF file with the outputs and inputs that the system description names.",
)
console = new_console()
LINES = 5
"""So many candidates are printed; the report has all."""
AsJson = Annotated[bool, Parameter(name="--json", negative=(), help="Print JSON.")]
SystemPath = Annotated[
    Path, Parameter(help="System description (TOML), its folder, or the name of one that comes with the package.")
]
RecordingPath = Annotated[Path, Parameter(help="The recording (NetCDF).")]
Folder = Annotated[Place, Parameter(help="Folder for the results.")]
WarmUp = Annotated[
    float, Parameter(help="Repeat the recording's first day for so long before its start [h], at least a step.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class Fitting:
    """How a recording is taken, where a fit begins, and where its simulations run."""

    run: Annotated[
        Path | None,
        Parameter(
            help="Estimator to start from: its folder, or the name of a system that comes with one. Without, a fit"
            " starts from the middle of the prior, and `diagnosis run` from the estimator beside the description."
        ),
    ] = None
    replay: Annotated[
        bool, Parameter(help="Drive the model with the recorded actuators in place of its control loops.")
    ] = False
    occupancy: Annotated[
        Literal["measured", "unknown"] | None,
        Parameter(help="Whether occupants were counted. Default: measured if the recording has them."),
    ] = None
    noise: Annotated[str | None, Parameter(help="Noise preset of the description. Default: `sensor`.")] = None
    workers: Annotated[
        int | None, Parameter(help="Processes on this machine that simulate in parallel. Default: one.")
    ] = None
    scheduler: Annotated[
        str | None, Parameter(help="Address of a Dask scheduler, to simulate on its workers instead.")
    ] = None

    minutes: Annotated[
        float | None,
        Parameter(
            help="Stop after about so many minutes, with an answer that says what it lacks. The same command with more"
            " minutes continues."
        ),
    ] = None

    @property
    def given(self) -> dict[str, Any]:
        """As keyword arguments, without those that were not given."""
        return {name: one for name, one in vars(self).items() if one is not None}


PLAIN = Fitting()
"""In this process, with whatever the recording has."""


@app.command
def residuals(
    system: SystemPath,
    recording: RecordingPath,
    *,
    run: Path | None = None,
    calibration: Path | None = None,
    set_: Annotated[list[str] | None, Parameter(name="--set", consume_multiple=True, negative=())] = None,
    replay: bool = False,
    noise: str | None = None,
    warm_up: float = WARM_UP,
    stretch: Stretch = LONGEST,
    as_json: AsJson = False,
    patience: Patience = PATIENT,
) -> int:
    """Simulate a recording with given, estimated or calibrated parameters, and print the residuals.

    Parameters
    ----------
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


@app.command
@resumable()
def calibrate(
    system: SystemPath,
    recording: RecordingPath,
    *,
    out: Folder,
    starts: Positive = STARTS,
    warm_up: WarmUp = WARM_UP,
    seed: NotNegative = 0,
    as_json: AsJson = False,
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
    starts
        Number of start points at most. Those after the first are drawn from the prior, and tried where a fit leaves
        more than noise.
    seed
        Seed of the further start points.
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


@app.command
@resumable()
def forecast(
    system: SystemPath,
    recording: Path,
    *,
    out: Folder,
    context: float = 168.0,
    ahead: float = 336.0,
    calibration: Path | None = None,
    starts: Positive | None = None,
    as_json: AsJson = False,
    stretch: Stretch = LONGEST,
    fitting: Fitting = PLAIN,
    patience: Patience = PATIENT,
    report: Reporting = USUAL,
) -> int:
    """Estimate parameters from a recording's first days, simulate the days after, and compare.

    Writes forecast.json and forecast.html. The recording's inputs drive the model in the days ahead.

    Parameters
    ----------
    recording
        The recording (NetCDF), as long as context and forecast together.
    context
        Length of the first part, from which the parameters are estimated [h].
    ahead
        Length of the forecast [h].
    calibration
        Folder of a `diagnosis calibrate`, in place of a calibration on the context. Not with --run, --starts or
        --noise.
    starts
        Start points of the calibration on the context. Default: as `diagnosis calibrate`.
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


@app.command
@resumable()
def run(
    system: SystemPath,
    recording: RecordingPath,
    *,
    out: Folder,
    warm_up: WarmUp = WARM_UP,
    seed: NotNegative = 0,
    as_json: AsJson = False,
    stretch: Stretch = LONGEST,
    fitting: Fitting = PLAIN,
    patience: Patience = PATIENT,
    reporting: Reporting = USUAL,
) -> int:
    """Diagnose the gap between a recording and the model: where it lies, which effect causes it, how far it shrinks.

    Writes report.html and report.json.

    Parameters
    ----------
    seed
        Seed of bootstrap replicates and placebos.
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


@app.command
@resumable()
def farm(
    system: SystemPath,
    *,
    out: Place,
    recordings: Positive = 400,
    seed: NotNegative | None = None,
    hours: float = 168.0,
    noise: str = "sensor",
    workers: Positive | None = None,
    scheduler: str | None = None,
    as_json: AsJson = False,
    patience: Patience = PATIENT,
    report: Reporting = USUAL,
) -> int:
    """Calibrate what `diagnosis run` says of a system, by recordings whose cause is known.

    Makes the recordings, diagnoses each, and writes verdict.json: put it beside the system's description. Two fast
    cores make about 250 recordings of a week in an hour. The same command goes on from where it stopped. The exit code
    is 3 where recordings failed or are too few.

    Parameters
    ----------
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


app.command(app_, name="app")
app.command(blind)


def main() -> None:
    """Entry point of the console script."""
    raise SystemExit(start(app))


if __name__ == "__main__":
    main()
