"""The command ``trainer tune``: a thin shell over :func:`trainer.training.tuning.tune`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.table import Table

from shared.console import new_console, resumable
from shared.logs import USUAL, Reporting


@resumable()
def tune(
    dataset: Path,
    /,
    *,
    out: Path,
    model: str = "patch-transformer",
    trials: int = 20,
    minutes: float | None = None,
    steps: int | None = None,
    context: float | None = None,
    channels: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    noise: str = "none",
    systems: int | None = None,
    seed: int = 0,
    json: Annotated[bool, Parameter(negative="")] = False,
    report: Reporting = USUAL,
) -> None:
    """Search an estimator's options, batch size and learning rate with Optuna, on validation systems only.

    The first trial is the estimator's defaults. The same command goes on with an unfinished search; more trials
    prolong a finished one. Writes OUT/best.json, which `trainer fit DATASET --options OUT/best.json` reads.

    Parameters
    ----------
    dataset
        Folder made by `datagen run`.
    out
        Folder of the search.
    model
        Estimator, as for `trainer fit`.
    trials
        How many in all.
    minutes
        Wall-clock budget of each trial [min]; 2 by default.
    steps
        Optimiser steps of each trial in place of minutes.
    context
        Length of a window [h]; the system description's by default.
    channels
        What the estimator reads, as for `trainer fit`.
    noise
        Sensor preset, as for `trainer fit`.
    systems
        Train on the first so many training systems only.
    seed
        Of every fit, and of the search.
    json
        Print best.json, and nothing else, on stdout.
    """
    from trainer.runs.checkpoint import beside_mean
    from trainer.training.tuning import BEST
    from trainer.training.tuning import tune as run_tune

    best = run_tune(
        dataset,
        out,
        model=model,
        trials=trials,
        minutes=minutes,
        steps=steps,
        context_hours=context,
        channels=channels,
        noise=noise,
        systems=systems,
        seed=seed,
        progress=not report.quiet,
    )
    if json:
        sys.stdout.write(best.model_dump_json(indent=1) + "\n")
        return
    table = Table(title=f"{best.model}: best of {best.trials} trials", show_header=False)
    for name, value in {**best.options, "batch_size": best.batch_size, "lr": best.lr}.items():
        table.add_row(name, f"{value:.4g}" if isinstance(value, float) else str(value))
    assert best.validation_loss is not None  # of a search that came to an end
    table.add_row("validation loss", beside_mean(best.validation_loss, best.mean_loss))
    if best.default_loss is not None:
        table.add_row("with the defaults", f"{best.default_loss:.4f}")
    console = new_console()
    console.print(table)
    console.print(f"written: {out / BEST}", markup=False, soft_wrap=True)
