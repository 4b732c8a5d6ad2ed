"""The command ``trainer``: each sub-command is a thin shell over the public function of the same name."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from shared.console import new_app, new_console, resumable, start
from shared.errors import EstimatorError
from shared.logs import USUAL, Reporting, fields, logger
from trainer.commands.benchmark import benchmark
from trainer.commands.info import info
from trainer.commands.predict import predict
from trainer.commands.tune import tune
from trainer.models import ESTIMATORS
from trainer.posterior.command import calibration, posterior

app = new_app(
    "trainer",
    """Fit an estimator to a dataset of simulated systems, evaluate it, and estimate parameters from a recording.

A first session, on a dataset made by `datagen run`:

    trainer fit DATASET --model ridge --context 168 --out runs/ridge

    trainer evaluate runs/ridge DATASET

    trainer predict runs/ridge recording.nc""",
)

for one in (info, posterior, calibration, predict, benchmark, tune):
    app.command(one)

_log = logger("trainer.cli")
MODELS = f"Estimator: {', '.join(ESTIMATORS)}."


@app.command
@resumable("--resume", instead_of=["--overwrite"])
def fit(
    dataset: Path,
    /,
    *,
    out: Path,
    model: Annotated[str | None, Parameter(help=MODELS)] = None,
    context: float | None = None,
    other_contexts: Annotated[list[float] | None, Parameter(consume_multiple=True, negative="")] = None,
    channels: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    optional: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    noise: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="")] = ("none",),
    steps: int | None = None,
    minutes: float | None = None,
    batch_size: int | None = None,
    lr: float | None = None,
    patch: int | None = None,
    option: dict[str, float] | None = None,
    options: Path | None = None,
    begin_with: Path | None = None,
    coarse: Annotated[bool, Parameter(negative="")] = False,
    facts: Annotated[bool, Parameter(negative="")] = False,
    device: str = "cpu",
    systems: int | None = None,
    keep: Literal["best", "last"] = "best",
    seed: int = 0,
    threads: int = 1,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
    resume: Annotated[bool, Parameter(negative="")] = False,
    report: Reporting = USUAL,
) -> None:
    """Fit an estimator to the training systems of a dataset.

    The run folder gets weights.safetensors, estimator.json (everything needed to use them), curve.csv and, for
    iterative training, curve.png.

    Examples: `trainer fit DATASET --out RUN` is the paper's estimator and recipe; `--model ridge` takes seconds;
    `--noise sensor --channels OUTPUT OUTPUT time_of_day` trains for real sensors, two outputs and the time of day.

    Parameters
    ----------
    dataset
        Folder made by `datagen run`.
    out
        Run folder to write.
    context
        Length of a window [h]; the system description's by default.
    channels
        What the estimator reads: outputs or inputs of the system, and time_of_day or day_of_week from the time stamps;
        the system description's by default.
    other_contexts
        Further lengths of a window [h], for the multiscale and the regression transformer: one estimator for them all.
    optional
        Outputs among the channels that a recording may lack, for the multiscale and the regression transformer.
    noise
        Sensor preset of the system description, drawn again for every window; "none" is noise-free. With several,
        each window draws one.
    steps
        Optimiser steps; the model's own number by default.
    minutes
        Wall-clock budget [min] in place of steps. Only a budget in steps is reproducible.
    batch_size
        Windows a step; the model's own by default (16 for the paper's).
    lr
        Learning rate; the model's own by default (1e-3 for the paper's). For the multiscale and the regression
        transformer it is AdamW's, and Muon has 20 times it.
    patch
        Samples of a patch, for the transformers (the paper's 12 by default).
    option
        A further option of the model, for example `--option.width 32`.
    options
        File of `trainer tune` with the model, its options, batch size and learning rate. Options given here take
        precedence.
    begin_with
        Run folder, or name of a shipped system, whose weights to start from. It must have the same channels and
        contexts. Parts that it lacks start untrained.
    coarse
        Round products to bfloat16 while training, for the multiscale and the regression transformer: faster on
        processors that have such products.
    facts
        Read the description's given facts, and parameters that happen to be known, as static inputs; `trainer predict`
        then takes them from the recording and with --known.
    device
        `cpu`, or `cuda` to train on a graphics card.
    systems
        Number of training systems to use, from the first on.
    keep
        Keep the weights that were best on the validation systems, or the last ones, even if they overfit.
    seed
        Seed of weights, windows, noise and dropout.
    threads
        torch's threads; more than one is slower unless the machine is idle.
    overwrite
        Replace the estimator in OUT. It stays until the new training has written its first weights.
    resume
        Continue an interrupted training in OUT, with --steps to the same weights. Start one if there is none.
    """
    from trainer.training.fitting import fit as run_fit

    chosen: dict[str, Any] = {}
    if options is not None:
        from trainer.training.tuning import read_options

        tuned = read_options(options)
        if model not in (None, tuned.model):
            raise EstimatorError(f"{options}: is of the model {tuned.model}; expected {model}, or no --model")
        model, chosen = tuned.model, dict(tuned.options)
        # a zero that somebody gives is to be refused, not to be passed over
        batch_size = tuned.batch_size if batch_size is None else batch_size
        lr = tuned.lr if lr is None else lr
    model = "patch-transformer" if model is None else model
    if patch is not None:
        chosen.pop("patch", None)
    chosen |= option or {}

    run = run_fit(
        dataset,
        out,
        model=model,
        context_hours=context,
        other_contexts=other_contexts,
        channels=channels,
        optional=optional,
        noise=" ".join(noise),
        steps=steps,
        minutes=minutes,
        batch_size=batch_size,
        lr=lr,
        patch=patch,
        options=chosen,
        begin_with=begin_with,
        coarse=coarse,
        facts=facts,
        device=device,
        systems=systems,
        keep=keep,
        seed=seed,
        threads=threads,
        overwrite=overwrite,
        resume=resume,
        progress=not report.quiet,
    )
    done = run.card.training
    _log.info(
        "%s: %s, step %d of %d kept, validation loss %s, %.1f s",
        *(out, model, done.best_step, done.steps, done.loss_text(), done.seconds),
        extra=fields(**done.model_dump(mode="json")),
    )


@app.command
def evaluate(
    run: Path,
    dataset: Path,
    /,
    *,
    windows: int = 1000,
    seed: int = 0,
    noise: str | None = None,
    context: float | None = None,
    without: Annotated[list[str] | None, Parameter(consume_multiple=True, negative="")] = None,
    ceiling: Path | None = None,
    out: Path | None = None,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Print R2 on windows of all systems ("paper") and of systems never trained on ("unseen"), beside the ceiling.

    Writes evaluation.json, evaluation.md, evaluation.csv, answers.csv and scatter.png. Intervals are 90 %,
    by system.

    Parameters
    ----------
    run
        Run folder made by `trainer fit`, or the name of a system that comes with an estimator.
    dataset
        Dataset of the same system. With another root seed than the training's, all of its systems are unseen.
    windows
        Disjoint windows drawn for each protocol; fewer where there are fewer.
    seed
        Seed of the windows and the sensor noise.
    noise
        Sensor preset; what the run was trained on by default.
    context
        Length of a window [h], one of those that the run was trained on.
    without
        Optional channels to leave out.
    ceiling
        File of `datagen identifiability`; DATASET/identifiability.json by default.
    out
        Where the files go; by default RUN, or NAME-results for an estimator that comes with the package.
    json
        Print the evaluation as JSON, and nothing else, on stdout.
    """
    from trainer.evaluating.evaluation import evaluate as run_evaluate
    from trainer.evaluating.report import notes, terminal_table
    from trainer.runs.checkpoint import load_run

    loaded = load_run(run)
    result = run_evaluate(
        *(loaded, dataset),
        windows=windows,
        seed=seed,
        noise=noise,
        context_hours=context,
        without=without,
        ceiling=ceiling,
        out=out,
    )
    if json:
        print(result.model_dump_json(indent=1))
    else:
        new_console().print(terminal_table(result))
        print("\n".join(notes(result)))
        files = "evaluation.json, evaluation.md, evaluation.csv, answers.csv, scatter.png"
        print(f"written to {out or loaded.results}: {files}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point of the console script."""
    code = start(app, arguments)
    if code:
        sys.exit(code)


if __name__ == "__main__":
    main()
