"""Fit an estimator to a dataset (paper, section 4)."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

import shared
from shared.errors import EstimatorError
from shared.store import DatasetFolder
from trainer.checkpoint import CARD, WEIGHTS, Card, Run, Systems, Training, load_run, make_folder, shape_of
from trainer.data import load_records, rows_of
from trainer.encoding import make_encoding, split_channels
from trainer.models import build, estimator_class, option_defaults
from trainer.models.base import Recipe
from trainer.noise import Sensors
from trainer.training import Loop
from trainer.windows import Sampler, WindowSource, context_length, disjoint_windows

VALIDATION_WINDOWS = 512
WRITTEN = (
    *(CARD, WEIGHTS, "curve.csv", "curve.png"),
    *("evaluation.json", "evaluation.md", "evaluation.csv", "scatter.png"),
)
"""Files of a run folder."""


def fit(
    dataset_dir: Path | str,
    out: Path | str,
    *,
    model: str = "patch-transformer",
    context_hours: float | None = None,
    channels: list[str] | None = None,
    noise: str = "none",
    steps: int | None = None,
    minutes: float | None = None,
    batch_size: int | None = None,
    lr: float | None = None,
    patch: int | None = None,
    options: dict[str, Any] | None = None,
    seed: int = 0,
    threads: int = 1,
    overwrite: bool = False,
    progress: bool = False,
) -> Run:
    """Fit an estimator to the training systems of a dataset and keep the weights that were best on validation systems.

    Parameters
    ----------
    dataset_dir
        A dataset made by ``datagen run``.
    out
        Run folder to write: weights.safetensors, estimator.json, curve.csv, curve.png.
    model
        One of ``trainer.models.ESTIMATORS``.
    context_hours
        Length of a window [h]; the system description's by default.
    channels
        What the estimator reads: outputs, inputs, ``time_of_day``, ``day_of_week``; by default what the system
        description says.
    noise
        Sensor preset of the system description, drawn afresh for every window.
    steps, minutes
        Budget: optimiser steps, or wall-clock time [min]; the model's own number of steps by default.
    batch_size, lr
        Windows a step and learning rate of Adamax; the model's own by default (the paper's 16 and 1e-3).
    patch
        Samples of a patch, for a model that has patches.
    options
        Further options of the model, by name.
    seed
        Of initial weights, windows, noise and dropout: equal seeds give equal runs (with ``steps``, on one thread).
    threads
        torch's threads; more than one is slower unless the machine is idle.
    overwrite
        Replace an estimator that ``out`` already holds.
    progress
        Show a progress bar on stderr.

    Raises
    ------
    EstimatorError
        If an argument is wrong, or the loss stops being a number.
    DatasetError
        If the dataset cannot be used, or has no training or validation systems.
    """
    if threads < 1:
        raise EstimatorError(f"threads: is {threads}; expected at least 1")
    dataset = DatasetFolder(dataset_dir)
    recipe = _recipe(model, steps, minutes, batch_size, lr)
    chosen = dict(options or {})
    if patch is not None:
        if "patch" not in option_defaults(model):
            raise EstimatorError(f"patch: {model} has no patches; leave it out")
        chosen["patch"] = patch
    folder = Path(out)
    if (folder / CARD).exists() and not overwrite:
        raise EstimatorError(f"{folder}: already holds an estimator; choose another folder, or overwrite it")
    recorded, derived = split_channels(dataset.system, channels)
    sensors = Sensors(dataset.system, recorded, noise)
    records = load_records(dataset, recorded)
    training, validation = (rows_of(records, split, dataset.folder) for split in ("train", "validation"))
    hours = dataset.system.estimator.context_hours if context_hours is None else context_hours
    length = context_length(hours, records)
    encoding = make_encoding(dataset.system, records, derived, length, training)
    seeds = [int(s) for s in np.random.SeedSequence(seed).generate_state(4)]
    source = WindowSource(records, encoding, sensors, torch.Generator().manual_seed(seeds[0]))
    held_out = source.gather(
        *map(
            torch.from_numpy,
            disjoint_windows(
                validation, len(records.time), length, VALIDATION_WINDOWS, np.random.default_rng(seeds[1])
            ),
        )
    )
    with _torch_state(seeds[2], threads):
        network, merged = build(model, shape_of(encoding), chosen)
        card = Card(
            model=model,
            options=merged,
            context_hours=hours,
            noise=noise,
            encoding=encoding,
            system_name=dataset.system.name,
            system_hash=dataset.manifest.system_hash,
            fmu_sha256=dataset.manifest.fmu_sha256,
            training_systems=Systems.of(records, training),
            validation_systems=Systems.of(records, validation),
            validation_rmse={},
            training=Training(
                seed=seed,
                batch_size=recipe.batch_size,
                lr=recipe.lr,
                schedule=recipe.schedule,
                steps=0,
                best_step=0,
                validation_loss=math.inf,
                validation_windows=len(held_out.targets),
                seconds=0.0,
                stopped="running",
            ),
            versions={
                "zeroshot-fmu": shared.__version__,
                "python": platform.python_version(),
                "torch": torch.__version__,
                "numpy": np.__version__,
            },
        )
        make_folder(folder)
        for name in WRITTEN:  # an evaluation of what is replaced must not stand beside the new estimator
            (folder / name).unlink(missing_ok=True)
        loop = Loop(folder, card, network, Sampler(source, training, seeds[3]), held_out, recipe, minutes)
        loop.run(progress)
    return load_run(folder)


def _recipe(model: str, steps: int | None, minutes: float | None, batch_size: int | None, lr: float | None) -> Recipe:
    for name, value in (("steps", steps), ("minutes", minutes), ("batch_size", batch_size), ("lr", lr)):
        if value is not None and not 0 < value < math.inf:
            raise EstimatorError(f"{name}: is {value:g}; expected a positive number")
    if steps is not None and minutes is not None:
        raise EstimatorError("steps and minutes: both are given; expected one budget")
    own = estimator_class(model).recipe
    return replace(own, steps=steps or own.steps, batch_size=batch_size or own.batch_size, lr=lr or own.lr)


@contextmanager
def _torch_state(seed: int, threads: int) -> Iterator[None]:
    """Seed torch and set its threads, and put back both afterwards: a library must not change its host."""
    before = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(threads)
        try:
            yield
        finally:
            torch.set_num_threads(before)
