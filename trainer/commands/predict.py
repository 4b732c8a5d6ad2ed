"""The command ``trainer predict``: a thin shell over :func:`trainer.predicting.prediction.predict`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from shared.assignments import assignments
from shared.console import new_console
from shared.errors import SystemDescriptionError
from shared.shipped import DESCRIPTION, resolved_estimator
from shared.stretches import LONGEST, Stretch
from shared.system import System, load_system

if TYPE_CHECKING:
    from trainer.predicting.prediction import Prediction, Predictions


def predict(
    run: Path,
    file: Path,
    /,
    *,
    samples: int = 1000,
    out: Path | None = None,
    corner: Path | None = None,
    seed: int = 0,
    stretch: Stretch = LONGEST,
    known: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Estimate the parameters behind a recording, from its last context window.

    Where the run has a posterior (`trainer posterior`), the estimate is its median, with the central 90 % interval.
    Without one it is the run's answer, with the error on validation systems for windows of this length and these
    channels, where the run's card has it.

    Parameters
    ----------
    run
        Run folder made by `trainer fit`; or a system with an estimator, by its folder or the name of one that comes
        with the package.
    file
        NetCDF with the run's channels over (time) or (system, time), with units, as `diagnosis import` and a dataset's
        shards have them.
    samples
        Drawn from the posterior, at least 20: an interval takes that many.
    out
        NetCDF file for the samples: one variable per parameter.
    corner
        PNG file for the posterior's marginals and pairs, of a recording of one system.
    seed
        Of the samples.
    known
        Parameters and given facts that are known, as NAME=VALUE in the description's unit, for a run that was trained
        with --facts: all others are sharpened by them. The recording's own given facts are read as well.
    json
        Print the estimates as JSON, and nothing else, on stdout.
    """
    from trainer.predicting.prediction import predict as run_predict

    result = run_predict(
        run,
        file,
        samples=samples,
        seed=seed,
        stretch=stretch,
        known=assignments(known or [], "known"),
        out=out,
        corner=corner,
    )
    if json:
        sys.stdout.write(result.model_dump_json(indent=1) + "\n")
        return
    console = new_console()
    described = _described(run)
    words = {one.name: one.description for one in described.parameters} if described else {}
    for one in result.predictions:
        console.print(_table(one, words))
        _print_unlike(console, one, described.wider if described else "", file)
    if result.interval_doubt:
        console.print(f"[bold]Do not rely on the intervals:[/bold] {result.interval_doubt}.", markup=True)
    posterior = all(value.median is not None for one in result.predictions for value in one.parameters.values())
    if not posterior:
        console.print(result.rmse_note, markup=False)
    several = len(result.predictions) > 1
    if result.bridged:
        each = ", ".join(f"{one.bridged} of system {one.system}" for one in result.predictions if one.bridged)
        whose = f" ({each})" if several else ""
        console.print(f"{result.bridged} missing readings were interpolated{whose}.", markup=False)
    if result.interval_gaps:
        console.print(result.interval_gaps, markup=False)
    for sentence in result.failed:
        console.print(f"A channel was left out{' of all systems' if several else ''}: {sentence}", markup=False)
    if result.passed:
        console.print(
            f"A longer window was not read{' of any system' if several else ''}: {result.passed}", markup=False
        )
    if result.unfinished:
        console.print(result.unfinished, markup=False)
    if result.interval_note:
        console.print(result.interval_note, markup=False)
    for sentence in _on_constants(result):
        console.print(sentence, markup=False)
    for path in (out, corner):
        if path is not None:
            console.print(f"written to {path}", markup=False)


def _print_unlike(console: Console, one: Prediction, wider: str, file: Path) -> None:
    """In what a recording is unlike the training, and the description with ``wider`` ranges, if there is one."""
    if one.unlike is None:
        console.print("The run does not record its training data, so the recording was not compared with it.")
    if not one.unlike:
        return
    console.print("[bold]Unlike everything in training[/bold], so errors are larger than stated:", markup=True)
    for note in one.unlike:
        console.print(f"- {note}", markup=False)
    if wider:
        console.print(f"{wider} has wider ranges: trainer predict {wider} {file}", markup=False)


def _on_constants(result: Predictions) -> list[str]:
    """What was as declared in the training, and in what is said of errors and intervals."""
    said = []
    if result.held:
        said.append(f"The run was trained on systems that have {', '.join(result.held)} as declared.")
    told: dict[str, list[str]] = {}
    for what, names in (("the rmse", result.rmse_held), ("the intervals", result.interval_held)):
        if names:
            told.setdefault(", ".join(names), []).append(what)
    said += [
        f"The systems of {' and '.join(what)} have {names} as declared. A building with others has larger errors;"
        " `datagen run --uncertain` simulates such systems."
        for names, what in told.items()
    ]
    posterior = any(value.median is not None for one in result.predictions for value in one.parameters.values())
    if posterior and result.interval_held is None:
        said.append(
            "The posterior does not record whether its systems had constants as declared. Fit it again to know."
        )
    return said


def _table(one: Prediction, words: Mapping[str, str]) -> Table:
    """One estimate of each parameter: the posterior's where there is one, else the answer with its usual error."""
    name = "" if one.system is None else f"system {one.system}, "
    table = Table(title=f"{name}{one.begin} to {one.end}", box=None)
    posterior = all(value.median is not None for value in one.parameters.values())
    rmse = not posterior and all(value.rmse is not None for value in one.parameters.values())
    spread = ("90 % interval",) if posterior else ("+- rmse",) if rmse else ()
    remark = ("remark",) if any(value.at_bound for value in one.parameters.values()) else ()
    for column in ("parameter", "estimate", *spread, "unit", *remark):
        numeric = column in ("estimate", *spread)
        table.add_column(column, justify="right" if numeric else "left", no_wrap=numeric)
    for parameter, value in one.parameters.items():
        mark = ("at the end of its range" if value.at_bound else "",) if remark else ()
        label = f"{words[parameter]} ({parameter})" if words.get(parameter) else parameter
        estimate = value.median if posterior else value.value
        cells = [f"{value.low:.4g} to {value.high:.4g}"] if posterior else [f"{value.rmse:.2g}"] if rmse else []
        table.add_row(label, f"{estimate:.4g}", *cells, value.unit, *mark)
    return table


def _described(run: Path) -> System | None:
    """The description beside the estimator; None where none of its system lies there."""
    from trainer import load_run

    folder = resolved_estimator(run)
    try:
        system = load_system(folder.parent / DESCRIPTION)
    except SystemDescriptionError:  # a run of one's own: its parameters go by their names
        return None
    return system if system.hash() == load_run(run).card.system_hash else None
