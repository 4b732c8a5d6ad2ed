"""Fit an estimator to a dataset (paper, section 4)."""

from __future__ import annotations

import hashlib
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import torch
import xarray as xr

from shared.errors import EstimatorError
from shared.lock import FolderLock
from shared.logs import logger
from shared.store import DatasetFolder
from trainer.memory import memory_for
from trainer.models import build, estimator_class, option_defaults
from trainer.models.base import Estimator, Recipe
from trainer.reading.data import load_records
from trainer.reading.encoding import LATER
from trainer.reading.familiar import familiar
from trainer.reading.kind import Kind
from trainer.reading.missing import Missing
from trainer.reading.windows import Sampler, WindowSource, disjoint_windows
from trainer.runs.checkpoint import (
    CARD,
    Card,
    Errors,
    Keep,
    Run,
    Training,
    load_run,
    make_folder,
    read_card,
    shape_of,
)
from trainer.runs.state import STATE, check_settings
from trainer.runs.systems import Systems
from trainer.runs.validation import measured_errors
from trainer.runs.versions import versions_here
from trainer.seeds import check_device, check_seed, check_threads, noise_seed, torch_state
from trainer.training.beginning import check_same_model, encoding_of, take_memory, take_weights
from trainer.training.loop import Loop
from trainer.training.material import material_of, recipe_of
from trainer.training.place import check_place

_log = logger(__name__)

VALIDATION_WINDOWS = 512


def fit(
    dataset_dir: Path | str | xr.Dataset,
    out: Path | str,
    *,
    model: str = "patch-transformer",
    context_hours: float | None = None,
    other_contexts: list[float] | None = None,
    channels: list[str] | None = None,
    optional: list[str] | None = None,
    noise: str = "none",
    steps: int | None = None,
    minutes: float | None = None,
    batch_size: int | None = None,
    lr: float | None = None,
    patch: int | None = None,
    options: dict[str, Any] | None = None,
    begin_with: Path | str | None = None,
    coarse: bool = False,
    facts: bool = False,
    device: str = "cpu",
    systems: int | None = None,
    seed: int = 0,
    keep: Keep = "best",
    threads: int = 1,
    overwrite: bool = False,
    resume: bool = False,
    progress: bool = False,
) -> Run:
    """Fit an estimator to the training systems of a dataset.

    Parameters
    ----------
    dataset_dir
        A dataset made by ``datagen run``.
    out
        Run folder to write: weights.safetensors, estimator.json, curve.csv and, if it is trained by
        steps, curve.png.
    model
        One of ``trainer.models.ESTIMATORS``.
    context_hours
        Length of a window [h]; the system description's by default.
    other_contexts
        Further lengths [h] that the estimator shall read, for a model that can; half of the batches have these.
    channels
        What the estimator reads: outputs, inputs, ``time_of_day``, ``day_of_week``; by default what the system
        description says.
    noise
        Sensor preset of the system description, drawn afresh for every window. Of several, joined by spaces, each
        window draws one.
    optional
        Outputs among the channels that a recording may lack, for a model that reads windows with missing readings.
    steps, minutes
        Budget: optimiser steps, or wall-clock time [min]; the model's own number of steps by default.
    batch_size, lr
        Windows a step and learning rate; the model's own by default (the paper's 16 and 1e-3). Where Muon steps the
        inner matrices, the rate is AdamW's, and Muon has ``MUON_RATIO`` times it.
    patch
        Samples of a patch, for a model that has patches.
    options
        Further options of the model, by name.
    begin_with
        A run whose weights to begin with, of the same encoding. What this model has beyond that one begins untrained.
    coarse
        Round larger products to bfloat16 while training, for speed, with a model that can.
    facts
        Read the description's given facts, and parameters that are known, as static inputs, of which training reveals a
        random part. `trainer predict` then takes them (--known).
    device
        Where to train: ``cpu``, or ``cuda`` for a graphics card, which holds all records then.
    systems
        Train on the first so many training systems only; all by default.
    seed
        Of initial weights, windows, noise and dropout: equal seeds give equal runs (with ``steps``, on one thread).
    keep
        The weights that were best on validation systems, or the last ones, however well they know their own systems.
    threads
        torch's threads; more than one is slower unless the machine is idle.
    overwrite
        Replace an estimator that ``out`` already holds; it is there until there is a first one of this training.
    resume
        Go on with an unfinished training of the same settings in ``out``, to the same weights (with ``steps``) as if it
        had not been interrupted; begin where there is none; leave a finished one as it is.
    progress
        Show a progress bar on stderr.

    Raises
    ------
    EstimatorError
        If an argument is wrong, another training is at work in ``out``, or the loss stops being a number.
    DatasetError
        If the dataset cannot be used, or has no training or validation systems.
    """
    kind = _estimator_that_can(model, keep, coarse=coarse, patch=patch)
    check_threads(threads)
    check_seed(seed)
    dataset = DatasetFolder(dataset_dir)
    recipe = recipe_of(model, steps, minutes, batch_size, lr)
    chosen = dict(options or {}) | ({} if patch is None else {"patch": patch})
    folder = Path(out)
    if resume and overwrite:
        raise EstimatorError("resume and overwrite: both are given; expected one of them")
    check_place(folder, replacing=overwrite or resume)
    records, training, validation, encoding, sensors, hours, length = material_of(
        dataset,
        model,
        context_hours=context_hours,
        other_contexts=other_contexts,
        channels=channels,
        optional=optional,
        noise=noise,
        systems=systems,
        facts=facts,
    )
    first = None if begin_with is None else load_run(begin_with)
    if first is not None and first.folder is not None and Path(out).exists() and Path(out).samefile(first.folder):
        raise EstimatorError(
            f"begin_with: is {begin_with}, the folder to write to; expected another folder for one of both: a training"
            " that is interrupted goes on from the weights that it began with"
        )
    if first is not None:
        encoding = encoding_of(first, encoding)
    gaps = Missing(encoding.recorded, encoding.outputs, optional or []) if kind.reads_missing else None
    seeds = [int(s) for s in np.random.SeedSequence(seed).generate_state(6)]
    place = check_device(device)
    generator = torch.Generator(place).manual_seed(noise_seed(seed))
    source = WindowSource(records, encoding, sensors, generator, gaps, "random")
    records = replace(records, values=np.empty((0, 0, 0), np.float32))  # the source has its own copy
    where, starts = disjoint_windows(
        validation, len(records.time), length, VALIDATION_WINDOWS, np.random.default_rng(seeds[1])
    )
    held_out = source.gather(torch.from_numpy(where), torch.from_numpy(starts), length)
    with torch_state(seeds[2], threads):
        network, merged = build(model, shape_of(encoding), chosen)
        network.coarse = coarse
        network.to(place)
        if encoding.shorter and encoding.shorter[0] < (least := merged.get("patch", 1)):
            raise EstimatorError(
                f"other_contexts: the shortest has {encoding.shorter[0]} samples; expected at least a patch's {least}"
            )
        if coarse and place.type == "cpu" and (times := slowdown()) > 1:
            _log.warning(
                "coarse: products in bfloat16 take %.1f times as long as others on this processor; leave it out", times
            )
        if first is not None:
            hashes = dataset.manifest.system_hash, dataset.manifest.fmu_sha256
            check_same_model(first, model, merged, *hashes)
        earlier = None if first is None else take_weights(network, first)
        of = Kind.of(dataset, load_records(dataset, []))
        card = Card(
            model=model,
            options=merged,
            context_hours=hours,
            noise=noise,
            encoding=encoding,
            begun_with=earlier,
            system_name=dataset.system.name,
            system_hash=dataset.manifest.system_hash,
            fmu_sha256=dataset.manifest.fmu_sha256,
            training_systems=Systems.of(records, training),
            validation_systems=Systems.of(records, validation),
            validation_rmse={},
            familiar=familiar(source, training, seeds[5]),
            dataset=of,
            held=of.held,
            training=Training(
                seed=seed,
                batch_size=recipe.batch_size,
                lr=recipe.lr,
                schedule=recipe.schedule,
                steps=0,
                best_step=0,
                validation_loss=math.inf,
                mean_loss=held_out.targets.square().mean().item(),  # they are standardised by training systems
                validation_windows=len(held_out.targets),
                seconds=0.0,
                stopped="running",
                minutes=minutes,
                planned=None if minutes else recipe.steps,
                keep=keep,
                coarse=coarse,
                data=None if first is None else of.fingerprint,
            ),
            versions=versions_here(),
        )
        if first is not None:
            take_memory(card, first.card)
        settings = settings_of(card, None if minutes else recipe.steps)
        make_folder(folder)

        def measure(kept: Estimator) -> list[Errors]:
            return measured_errors(kept, card, source, dataset.system, validation, seeds[4], progress)

        with FolderLock(folder, kind=EstimatorError):
            if _earlier_ending(folder, card, recipe, minutes, overwrite=overwrite, resume=resume):
                return load_run(folder)
            sampler = Sampler(source, training, seeds[3], length)
            with memory_for(f"steps of {recipe.batch_size} windows (batch_size)"):
                Loop(folder, card, network, sampler, held_out, recipe, minutes, settings, measure).run(progress)
    return load_run(folder)


def _estimator_that_can(model: str, keep: str, *, coarse: bool, patch: int | None) -> type[Estimator]:
    """The model's class, where it has what the options ask of it."""
    if keep not in get_args(Keep):
        raise EstimatorError(f"keep: is {keep!r}; expected best or last")
    if patch is not None and "patch" not in option_defaults(model):
        raise EstimatorError(f"patch: {model} has no patches; leave it out")
    kind = estimator_class(model)
    if keep == "last" and not kind.iterates:
        raise EstimatorError(f"keep: {model} is solved, not trained by steps: there are no last weights; leave it out")
    if coarse and not kind.rounds:
        raise EstimatorError(f"coarse: {model} is trained with all digits only; leave it out")
    return kind


def _earlier_ending(
    folder: Path, card: Card, recipe: Recipe, minutes: float | None, *, overwrite: bool, resume: bool
) -> bool:
    """Whether the folder, which is locked, holds this very training, ended. What is not to go on is removed.

    Raises EstimatorError if another training has ended there, or what is to be resumed has other settings.
    """
    if not overwrite and not resume and (folder / CARD).exists():  # another training has ended in between
        raise EstimatorError(f"{folder}: holds an estimator by now; choose another folder, or overwrite it")
    if not resume:
        (folder / STATE).unlink(missing_ok=True)
        return False
    if (folder / STATE).exists() or not (folder / CARD).exists():
        return False
    done = read_card(folder)
    finished = done.training.stopped in ("steps", "minutes")
    steps = done.training.steps if finished else done.training.planned or recipe.steps
    wanted = settings_of(card, None if minutes else recipe.steps)
    check_settings(folder / CARD, settings_of(done, None if minutes else steps), wanted)
    return finished


def settings_of(card: Card, steps: int | None) -> dict[str, Any]:
    """What makes a training this one and no other, as JSON holds it; ``steps`` is None where the budget is minutes."""
    training, encoding = card.training, card.encoding
    # what earlier versions did not write must not tell an equal training from theirs
    known = [k.model_dump_json(exclude=LATER) for k in (card.training_systems, card.validation_systems, encoding)]
    return {
        "model": card.model,
        "options": card.options,
        "context_hours": card.context_hours,
        "channels": encoding.channels,
        "noise": card.noise,
        "batch_size": training.batch_size,
        "lr": training.lr,
        "schedule": training.schedule,
        "steps": steps,
        "minutes": training.minutes,
        "keep": training.keep,
        "coarse": training.coarse or None,  # as in states of trainings that knew nothing of it
        "facts": encoding.facts or None,
        "seed": training.seed,
        "begun with": card.begun_with,
        "dataset": training.data,  # its systems and its scales, which tell it otherwise, are then mixed with another's
        "training systems": len(card.training_systems.indices),
        "data": hashlib.sha256("".join([*known, card.system_hash]).encode()).hexdigest(),
    }


def slowdown() -> float:
    """Time of an encoder's product in bfloat16 over that in single precision, the median of a few in turn.

    Some processors compute with rounded numbers in software.
    """
    ratios = []
    with torch.inference_mode():
        exact = torch.ones(2048, 256), torch.ones(256, 256)
        coarse = tuple(one.bfloat16() for one in exact)
        _seconds(*exact), _seconds(*coarse)  # the first ones prepare what later ones find
        for _ in range(5):
            single = _seconds(*exact)
            ratios.append(_seconds(*coarse) / single)
    return float(np.median(ratios))


def _seconds(left: torch.Tensor, right: torch.Tensor) -> float:
    began = time.perf_counter()
    torch.mm(left, right)
    return time.perf_counter() - began
