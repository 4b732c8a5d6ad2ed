"""Fit a posterior to a fitted estimator (neural posterior estimation; the paper's future work).

Neither training nor test systems need take part. The flow is fitted to one half of the validation systems, as the
estimator's errors on systems that it trained on are smaller than they will be; training stops, and temperatures are
set, by the other half. Systems of the test split are not opened.
"""

from __future__ import annotations

import copy
import math
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
import xarray as xr
import zuko
from torch import nn

import shared
from shared.errors import EstimatorError
from shared.lock import FolderLock
from shared.logs import fields, logger
from shared.progress import tracked
from shared.store import DatasetFolder
from trainer.evaluating.evaluation import check_records, check_same_system
from trainer.memory import memory_for
from trainer.posterior.card import PosteriorCard, tell_kind
from trainer.posterior.checkpoint import CARD, load_posterior, save_posterior
from trainer.posterior.conditions import Contexts, draw_contexts, source_of
from trainer.posterior.flow import PosteriorFlow
from trainer.posterior.inference import Posterior
from trainer.posterior.prior import Prior
from trainer.posterior.tempering import temper
from trainer.reading.data import load_records, rows_of
from trainer.reading.kind import Kind
from trainer.runs.checkpoint import Run, load_run
from trainer.runs.systems import Systems
from trainer.runs.unfinished import check_not_replaced, unfinished
from trainer.seeds import check_seed, check_threads, torch_state

_log = logger(__name__)
BATCH = 256
LR = 1e-3
WEIGHT_DECAY = 1e-2
CLIP = 5.0
DECAY = 0.997
"""Of the running mean of the weights, which is what is kept: its centre strays less than that of single weights."""
PATIENCE = 8
"""Epochs without a better density on the calibration systems, after which training stops."""
FEWEST = 4
"""Validation systems."""


def fit_posterior(
    run: Run | Path | str,
    dataset_dir: Path | str | xr.Dataset,
    *,
    systems: int | None = None,
    training_systems: int = 0,
    windows_per_system: int = 6,
    epochs: int = 60,
    options: dict[str, Any] | None = None,
    seed: int = 0,
    threads: int = 1,
    overwrite: bool = False,
    progress: bool = False,
) -> Posterior:
    """Fit a flow for the parameters given what the estimator makes of a window; write it into the run folder.

    The arguments are those of `trainer posterior`, of a run folder or a run loaded from one. Windows are drawn under
    the conditions of the estimator's own training, but for how often each length is drawn. Of training systems those
    come first that the run has not seen. ``options`` are the flow's: ``summary``, ``width``, ``splines``, ``bins``,
    ``dropout``. Equal seeds give equal posteriors. Warns where fewer systems calibrate than 90 % takes
    (:data:`trainer.posterior.card.ENOUGH`), and where the posterior tells less than the prior. Raises EstimatorError if
    an argument is wrong, the run and the dataset do not fit, another run is at work in the run folder, or the density
    stops being a number; DatasetError if the dataset cannot be used, or has no validation systems.
    """
    check_seed(seed)
    run = run if isinstance(run, Run) else load_run(run)
    if cut_short := unfinished(run.card):
        _log.warning("%s: %s", run.folder, cut_short)
    if run.folder is None:
        raise EstimatorError("run: is in no folder; expected one made by `trainer fit`")
    if run.results != run.folder:
        raise EstimatorError(f"{run.folder}: comes with the package; copy it, and fit the posterior to the copy")
    check_threads(threads)
    for name, value in (("windows_per_system", windows_per_system), ("epochs", epochs)):
        if value < 1:
            raise EstimatorError(f"{name}: is {value}; expected at least 1")
    _check_place(run.folder, overwrite)
    with FolderLock(run.folder, kind=EstimatorError):
        check_not_replaced(run)
        _check_place(run.folder, overwrite)  # another may have ended in between
        return _fit(
            *(run, run.folder, DatasetFolder(dataset_dir), systems, training_systems, windows_per_system, epochs),
            *(options or {}, seed, threads, progress),
        )


def _check_place(folder: Path, overwrite: bool) -> None:
    if (folder / CARD).exists() and not overwrite:
        raise EstimatorError(f"{folder}: already has a posterior; overwrite it, or leave it")


def _fit(
    run: Run,
    folder: Path,
    dataset: DatasetFolder,
    systems: int | None,
    training_systems: int,
    windows_per_system: int,
    epochs: int,
    options: dict[str, Any],
    seed: int,
    threads: int,
    progress: bool,
) -> Posterior:
    """What :func:`fit_posterior` does in a folder that it has to itself."""
    begin = time.monotonic()
    check_same_system(run.card, dataset)
    index = load_records(dataset, [])
    check_records(run.card, index, dataset.folder, max(run.card.encoding.lengths))
    kind = Kind.of(dataset, index)
    tell_kind(kind, run.card, dataset.folder)
    prior = Prior.of(dataset.system)
    seeds = [int(s) for s in np.random.SeedSequence(seed).generate_state(5)]
    fitting, calibration = _halves(rows_of(index, "validation", dataset.folder), systems, seeds[0])
    extra = index.of_split("train")
    if not 0 <= training_systems <= len(extra):
        raise EstimatorError(f"training_systems: is {training_systems}; expected 0 to the dataset's {len(extra)}")
    # those that the run has not seen come first: its errors on the others are too small
    seen = run.card.seen(dataset.manifest.system_hash, index)[extra]
    mixed = np.random.default_rng(seeds[0]).permutation(len(extra))
    extra = np.sort(extra[mixed[np.argsort(seen[mixed], kind="stable")][:training_systems]])
    fitting = np.sort(np.concatenate([fitting, extra]))
    few = max(1, windows_per_system // 2)
    rows = np.sort(np.concatenate([fitting, calibration]))
    source, parameters = source_of(run, dataset, rows)  # reading the shards is half of the cost: once
    places = [np.searchsorted(rows, part) for part in (fitting, calibration)]
    asked = memory_for(f"{windows_per_system} windows of each system (windows_per_system)")
    with asked, torch_state(seeds[3], threads):
        fit_to = draw_contexts(run, prior, source, parameters, places[0], windows_per_system, seeds[1])
        # intervals of what is unknown are to cover: of the windows that calibrate them none tells a parameter
        source = source.under(source.sensors, source.generator, source.gaps, "given")
        held_out = draw_contexts(run, prior, source, parameters, places[1], few, seeds[2])
        del source
        sizes = (len(run.card.encoding.lengths), run.card.encoding.outputs)
        flow, facts = train_flow(fit_to, held_out, *sizes, epochs, options, progress)
        temper(flow, held_out, seeds[4])
    names = run.card.encoding.parameters
    card = PosteriorCard(
        estimator_sha256=run.card.weights_sha256,
        logarithmic=prior.log.tolist(),
        dataset=kind,
        context=fit_to.context.shape[1],
        lengths=run.card.encoding.lengths,
        options=options,
        fitting_systems=Systems.of(index, fitting),
        calibration_systems=Systems.of(index, calibration),
        fitting_windows=len(fit_to.z),
        calibration_windows=len(held_out.z),
        training_systems_used=int(run.card.seen(dataset.manifest.system_hash, index)[extra].sum()),
        temperatures=[dict(zip(names, row.exp().tolist(), strict=True)) for row in flow.log_temperature[:, 0]],
        temperatures_lacking=[dict(zip(names, row.exp().tolist(), strict=True)) for row in flow.log_temperature[:, 1]],
        seed=seed,
        seconds=round(time.monotonic() - begin, 2),
        versions={
            "zeroshot-fmu": shared.__version__,
            "python": platform.python_version(),
            "torch": torch.__version__,
            "zuko": zuko.__version__,
        },
        **facts,
    )
    save_posterior(folder, card, flow)
    if doubt := card.doubt():
        _log.warning("%s: %s", folder, doubt)
    done = load_posterior(run)
    assert done is not None
    return done


def _halves(rows: np.ndarray, systems: int | None, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Validation systems to fit to, and to calibrate with."""
    if len(rows) < FEWEST or (systems is not None and not FEWEST <= systems <= len(rows)):
        raise EstimatorError(
            f"systems: is {len(rows) if systems is None else systems}; expected {FEWEST} or more validation"
            f" systems, and no more than the dataset's {len(rows)}: half of them fit, the other half calibrates"
        )
    mixed = np.random.default_rng(seed).permutation(rows)[:systems]
    half = len(mixed) // 2
    return np.sort(mixed[:half]), np.sort(mixed[half:])


def train_flow(
    fit_to: Contexts,
    held_out: Contexts,
    lengths: int,
    outputs: int,
    epochs: int,
    options: dict[str, Any],
    progress: bool = False,
) -> tuple[PosteriorFlow, dict[str, Any]]:
    """Train a flow on windows; keep the weights with the best mean log density on those held out.

    What is judged and kept is a running mean of the weights over the steps (Polyak and Juditsky, 1992, Acceleration of
    stochastic approximation by averaging). Returns it with ``gain`` (mean log density over the prior's [nat]),
    ``epochs`` and ``best_epoch``. Raises EstimatorError if the density stops being a number, or an option is unknown.
    """
    try:
        flow = PosteriorFlow(fit_to.z.shape[1], fit_to.context.shape[1], lengths, outputs, **options)
    except TypeError as error:
        raise EstimatorError(f"options: {error}") from None
    flow.standardise(fit_to.context, fit_to.z)
    smooth = copy.deepcopy(flow)
    optimiser = torch.optim.AdamW(flow.parameters(), lr=LR, weight_decay=WEIGHT_DECAY)
    steps = math.ceil(len(fit_to.z) / BATCH)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, epochs * steps)
    prior = torch.distributions.Normal(0.0, 1.0).log_prob(held_out.z).sum(dim=1).mean().item()
    best, best_epoch, kept, epoch = -math.inf, 0, copy.deepcopy(flow.state_dict()), 0
    step = 0
    numbers = range(1, epochs + 1)
    for epoch in tracked(numbers, "posterior", shown=progress):
        flow.train()
        for chosen in torch.randperm(len(fit_to.z)).split(BATCH):
            loss = -flow.raw_log_prob(fit_to.context[chosen], fit_to.z[chosen]).mean()
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(flow.parameters(), CLIP)
            optimiser.step()
            schedule.step()
            _average(smooth, flow, step)
            step += 1
        gain = mean_log_prob(smooth, held_out) - prior
        _log.debug("epoch %d: %.3f nat above the prior", epoch, gain, extra=fields(epoch=epoch, gain=gain))
        if not math.isfinite(gain):
            raise EstimatorError(f"the posterior's density is not a number in epoch {epoch}; try another seed")
        if gain > best:
            best, best_epoch, kept = gain, epoch, copy.deepcopy(smooth.state_dict())
        elif epoch - best_epoch >= PATIENCE:
            break
    flow.load_state_dict(kept)
    flow.eval()
    return flow, {"gain": best, "epochs": epoch, "best_epoch": best_epoch}


def _average(smooth: nn.Module, flow: nn.Module, step: int) -> None:
    """Move running means of weights towards those after a step, the first is 0; early on they forget faster."""
    share = 1.0 if step == 0 else 1 - min(DECAY, (1 + step) / (10 + step))
    with torch.no_grad():
        for mean, weights in zip(smooth.parameters(), flow.parameters(), strict=True):
            mean.lerp_(weights, share)


def mean_log_prob(flow: PosteriorFlow, windows: Contexts) -> float:
    """Mean log density of the truth, before the temperatures [nat]."""
    flow.eval()
    with torch.no_grad():
        pairs = zip(windows.context.split(4096), windows.z.split(4096), strict=True)
        return torch.cat([flow.raw_log_prob(context, z) for context, z in pairs]).mean().item()
