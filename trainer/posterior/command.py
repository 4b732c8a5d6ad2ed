"""The commands ``trainer posterior`` and ``trainer calibration``: thin shells over functions of this package."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from shared.console import new_console
from shared.logs import USUAL, Reporting, logger

_log = logger(__name__)


def posterior(
    run: Path,
    dataset: Path,
    /,
    *,
    systems: int | None = None,
    training_systems: int = 0,
    windows_per_system: int = 6,
    epochs: int = 60,
    seed: int = 0,
    threads: int = 1,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
    report: Reporting = USUAL,
) -> None:
    """Fit a posterior to an estimator: from then on `trainer predict` gives intervals and samples.

    A normalising flow is fitted to the estimator's errors on one half of the validation systems. The other half stops
    its training and sets the width of the intervals. This takes nine systems or more; with fewer a warning says so.
    Test systems take no part. The run folder gets posterior.safetensors and posterior.json.

    Parameters
    ----------
    run
        Run folder made by `trainer fit`.
    dataset
        Dataset of the training, or another one of the same system.
    systems
        Number of validation systems to use; all by default.
    training_systems
        Fit the flow to so many training systems as well. The estimator knows them, so intervals become too narrow.
    windows_per_system
        Windows of each fitting system, and half as many of each calibration system.
    epochs
        Largest number of epochs; training stops early.
    seed
        Seed of systems, windows, noise and weights.
    threads
        torch's threads; more than one is slower unless the machine is idle.
    overwrite
        Replace a posterior that RUN already has.
    """
    from trainer.posterior.fitting import fit_posterior

    card = fit_posterior(
        run,
        dataset,
        systems=systems,
        training_systems=training_systems,
        windows_per_system=windows_per_system,
        epochs=epochs,
        seed=seed,
        threads=threads,
        overwrite=overwrite,
        progress=not report.quiet,
    ).card
    _log.info(
        "%s: posterior from %d windows of %d systems, calibrated by %d others; %.2f nat above the prior, %.0f s",
        *(run, card.fitting_windows, len(card.fitting_systems.indices), len(card.calibration_systems.indices)),
        *(card.gain, card.seconds),
    )


def calibration(
    run: Path,
    dataset: Path,
    /,
    *,
    windows: int = 2000,
    samples: int = 400,
    noise: str | None = None,
    context: float | None = None,
    without: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    seed: int = 0,
    out: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Check a posterior: coverage, rank histograms and scores on systems that it has never seen.

    Writes calibration.json, calibration.md, calibration.csv, sbc.png (flat if calibrated) and coverage.png. Intervals
    are 90 %, by system.

    Parameters
    ----------
    run
        Run folder made by `trainer fit` and `trainer posterior`.
    dataset
        Dataset of the same system. With a root seed that neither training nor posterior has seen, all of its systems
        are unseen; otherwise those of its test split.
    windows
        Disjoint windows; fewer where there are fewer.
    samples
        Of each window's posterior, at least 20.
    noise
        Sensor preset of the system description; the training's own by default.
    context
        Length of a window [h], one of those of the training; its main one by default.
    without
        Optional channels to leave out.
    seed
        Of windows, noise and samples.
    out
        Where the files go; by default RUN, or NAME-results for an estimator that comes with the package.
    json
        Print the figures as JSON, and nothing else, on stdout.
    """
    from trainer.posterior.assessment import calibration as run_calibration
    from trainer.posterior.report import notes, terminal_table
    from trainer.runs.checkpoint import load_run

    loaded = load_run(run)
    result = run_calibration(
        loaded,
        dataset,
        windows=windows,
        samples=samples,
        noise=noise,
        context_hours=context,
        without=without,
        seed=seed,
        out=out,
    )
    if json:
        sys.stdout.write(result.model_dump_json(indent=1) + "\n")
        return
    console = new_console()
    console.print(terminal_table(result))
    for line in notes(result):
        console.print(line, markup=False)
    console.print(
        f"written to {out or loaded.results}: calibration.json, calibration.md, calibration.csv, sbc.png, coverage.png",
        markup=False,
    )
