"""Whether a posterior can be believed: coverage, rank histograms and scores on systems that nothing was made with.

Windows of one system are not independent: intervals are by system, and tests of uniformity take one window of each.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
import xarray as xr

from shared.errors import EstimatorError
from shared.metrics import r2
from shared.store import DatasetFolder
from trainer.evaluating.evaluation import absent_channels, check_records, check_same_system, unseen_rows, window_length
from trainer.intervals import share_interval
from trainer.posterior.checkpoint import check_posterior_not_replaced, load_posterior
from trainer.posterior.figures import draw_coverage, draw_ranks
from trainer.posterior.inference import Posterior, check_samples, summarise
from trainer.posterior.report import LEVELS, Calibration, Coverage, LogScore, ParameterCalibration, write_calibration
from trainer.posterior.scores import covered, crps, positions, truncated_normal, uniformity
from trainer.reading.data import load_records
from trainer.reading.kind import Kind
from trainer.reading.noise import Sensors
from trainer.reading.windows import WindowSource, disjoint_windows
from trainer.runs.checkpoint import Run, load_run, make_folder
from trainer.runs.unfinished import check_findings_place, check_not_replaced, is_of, unfinished
from trainer.runs.validation import Typical, typical_errors
from trainer.seeds import check_seed


def calibration(
    run: Run | Path | str,
    dataset_dir: Path | str | xr.Dataset,
    *,
    windows: int = 2000,
    samples: int = 400,
    seed: int = 0,
    noise: str | None = None,
    context_hours: float | None = None,
    without: list[str] | None = None,
    out: Path | str | None = None,
) -> Calibration:
    """Measure a posterior on unseen systems; write calibration.json, calibration.md, calibration.csv and two figures.

    The arguments are those of `trainer calibration`, of a run folder or a run loaded from one; ``context_hours`` is the
    length of a window [h]. Raises EstimatorError if an argument is wrong, the run has no posterior or does not fit the
    dataset, or that has no unseen system; or if the estimator or the posterior in the run folder was replaced
    meanwhile; DatasetError if the dataset cannot be used.
    """
    check_seed(seed)
    run = run if isinstance(run, Run) else load_run(run)
    posterior = load_posterior(run)
    if posterior is None:
        raise EstimatorError(f"{run.folder}: has no posterior; `trainer posterior` fits one")
    if windows < 2:
        raise EstimatorError(f"windows: is {windows}; expected at least 2")
    check_samples(samples)
    card, encoding = run.card, run.card.encoding
    cut_short = unfinished(card, run.folder)
    folder = Path(out) if out is not None else run.results
    if folder is not None:
        check_findings_place(run, folder)
    dataset = DatasetFolder(dataset_dir)
    check_same_system(card, dataset)
    index = load_records(dataset, [])
    preset, length = card.noise if noise is None else noise, window_length(card, context_hours)
    absent = absent_channels(card, without or [])
    check_records(card, index, dataset.folder, length)
    unseen = unseen_rows(index, card.seen(dataset.manifest.system_hash, index) | posterior.card.seen(index))
    if not len(unseen):
        raise EstimatorError(f"{dataset.folder}: the run or its posterior was made with all of its systems that count")
    seeds = np.random.SeedSequence(seed).generate_state(4)
    where, starts = disjoint_windows(unseen, len(index.time), length, windows, np.random.default_rng(seeds[0]))
    needed = np.unique(where)
    source = WindowSource(
        load_records(dataset, encoding.recorded, needed),
        encoding,
        Sensors(dataset.system, encoding.recorded, preset),
        torch.Generator().manual_seed(int(seeds[1])),
        lambda values, _: values.masked_fill(absent, torch.nan),
    )
    batch = source.gather(torch.from_numpy(np.searchsorted(needed, where)), torch.from_numpy(starts), length)
    truth = index.parameters[where]
    drawn = posterior.sample_encoded(batch.windows, batch.time, samples, seed=int(seeds[2]))
    position = positions(truth, drawn, np.random.default_rng(seeds[3]))
    first = np.unique(where, return_index=True)[1]
    density = posterior.log_prob_encoded(batch.windows, batch.time, truth)
    estimate = run.estimates(run.answers(batch.windows, batch.time), length, without or [])
    hours = length * encoding.step / 3600
    typical = typical_errors(card, length, without or [], preset)
    result = Calibration(
        model=card.model,
        dataset=Kind.of(dataset, index),
        unfinished=cut_short,
        context_hours=hours,
        noise=preset,
        channels=[name for name in encoding.channels if name not in (without or [])],
        windows=len(truth),
        systems=len(needed),
        samples=samples,
        **_figures_of_merit(posterior, truth, drawn, estimate, typical, position, density, where, first),
    )
    if folder is not None:
        if is_of(run, folder):
            check_not_replaced(run)
            check_posterior_not_replaced(posterior)
        make_folder(folder)
        write_calibration(result, folder)
        title = f"{card.model}, {hours:g} h, noise {preset}, {len(first)} unseen systems"
        draw_ranks(position[first], encoding.parameters, title, folder / "sbc.png")
        draw_coverage(position, len(first), encoding.parameters, title, folder / "coverage.png")
    return result


def _figures_of_merit(
    posterior: Posterior,
    truth: np.ndarray,
    drawn: np.ndarray,
    estimate: np.ndarray,
    typical: Typical,
    position: np.ndarray,
    density: np.ndarray,
    where: np.ndarray,
    first: np.ndarray,
) -> dict[str, Any]:
    """Fields of a Calibration.

    ``truth``, ``estimate`` and ``position`` are (windows, parameters), ``drawn`` (windows, n, parameters), ``density``
    and ``where``, the system of each, (windows,); ``first`` are the windows of the rank tests. ``typical`` is the error
    of the estimate on validation systems under the same condition: without it there is no Gaussian to beat.
    """
    names, prior = posterior.run.card.encoding.parameters, posterior.prior
    inside = np.stack([covered(position, level) for level in LEVELS], axis=1)  # (windows, levels, parameters)
    inside = np.concatenate([inside, inside.mean(axis=2, keepdims=True)], axis=2)
    low, high = share_interval(where, inside)
    share = inside.mean(axis=0)
    cover = [
        {
            f"{level:g}": Coverage(share=share[i, k], low=_finite(low[i, k]), high=_finite(high[i, k]))
            for i, level in enumerate(LEVELS)
        }
        for k in range(len(names) + 1)
    ]
    chi2, kolmogorov = uniformity(position[first])
    n = drawn.shape[1]
    gaussian, gaussian_score = None, None
    if typical.rmse is not None:
        rmse = np.array([typical.rmse[name] for name in names])
        quantiles, log_density = truncated_normal(estimate, rmse, prior.low, prior.high, truth, n)
        gaussian, gaussian_score = crps(truth, quantiles, quantiles=True).mean(axis=0), float(log_density.mean())
    flat = prior.from_unit(((np.arange(n) + 0.5) / n)[:, None]) * np.ones(len(names))
    own = crps(truth, drawn).mean(axis=0)
    of_prior = crps(truth, np.broadcast_to(flat, drawn.shape), quantiles=True).mean(axis=0)
    found = summarise(drawn)
    of_mean, of_point = r2(truth, found.mean), r2(truth, estimate)
    width = np.median(prior.to_unit(found.high) - prior.to_unit(found.low), axis=0)
    parameters = {
        name: ParameterCalibration(
            coverage=cover[k],
            chi2_p=_finite(chi2[k]),
            ks_p=kolmogorov[k],
            crps=own[k],
            crps_gaussian=None if gaussian is None else gaussian[k],
            crps_prior=of_prior[k],
            r2_mean=_finite(of_mean[k]),
            r2_point=_finite(of_point[k]),
            width=width[k],
        )
        for k, name in enumerate(names)
    }
    score = LogScore(posterior=density.mean(), gaussian=gaussian_score, prior=prior.log_density(truth).mean())
    return {
        "parameters": parameters,
        "coverage_mean": cover[-1],
        "log_score": score,
        "gaussian_note": _gaussian_note(typical),
    }


def _gaussian_note(typical: Typical) -> str:
    if typical.rmse is None:
        return f"no Gaussian to compare with: {typical.note}"
    return f"Gaussian: the estimate with its {typical.note}, cut off at the ranges"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
