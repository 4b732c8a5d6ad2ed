"""Evaluate an estimator under two protocols, side by side (paper, section 4.1).

paper
    Windows of the full dataset: most of them belong to systems that the run trained on.
unseen
    Windows of systems that the run neither trained on nor chose its weights by. On the dataset of the training these
    are its test systems. On another dataset of the same system (another root seed) they are all its systems.

A system is known by system hash, root seed and index; what a run has seen stands in its estimator.json.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
import xarray as xr

from shared.errors import EstimatorError
from shared.metrics import r2, relative_accuracy
from shared.places import check_folder
from shared.store import DatasetFolder, Records
from trainer.evaluating.limit import find_ceiling
from trainer.evaluating.report import Answers, Evaluation, Protocol, write_answers, write_report
from trainer.evaluating.strata import strata
from trainer.figures import draw_scatter
from trainer.intervals import r2_interval, r2_with_mean
from trainer.reading.data import load_records
from trainer.reading.kind import Kind
from trainer.reading.noise import Sensors
from trainer.reading.windows import WindowSource, disjoint_windows
from trainer.runs.checkpoint import Card, Run, load_run, make_folder
from trainer.runs.unfinished import check_findings_place, check_not_replaced, is_of, unfinished
from trainer.seeds import check_seed

LEVEL = 0.9
"""Of the intervals."""


def evaluate(
    run: Run | Path | str,
    dataset_dir: Path | str | xr.Dataset,
    *,
    windows: int = 1000,
    seed: int = 0,
    noise: str | None = None,
    context_hours: float | None = None,
    without: list[str] | None = None,
    ceiling: Path | str | None = None,
    out: Path | str | None = None,
) -> Evaluation:
    """Evaluate a run on a dataset and write evaluation.json, evaluation.md, evaluation.csv, answers.csv, scatter.png.

    Parameters
    ----------
    run
        A run folder, or a run already loaded.
    dataset_dir
        A dataset of the system that the run was trained on.
    windows
        Disjoint windows drawn for each protocol; fewer where the dataset has fewer.
    seed
        Of the windows and of the sensor noise.
    noise
        Sensor preset; what the run was trained on by default.
    context_hours
        Length of a window [h], one of those that the run was trained on; its main one by default.
    without
        Optional channels of the run that are to be missing.
    ceiling
        A file of ``datagen identifiability``; by default the one in the dataset folder, if there.
    out
        Where the files go; by default the run folder, or NAME-results for an estimator that comes with the package.

    Raises
    ------
    EstimatorError
        If the run and the dataset do not fit, the dataset has no unseen system, or the estimator in the run folder was
        replaced meanwhile.
    DatasetError
        If the dataset cannot be used.
    ZeroshotError
        If the file of ceilings cannot be.
    """
    check_seed(seed)
    run = run if isinstance(run, Run) else load_run(run)
    card = run.card
    cut_short = unfinished(card, run.folder)
    dataset = DatasetFolder(dataset_dir)
    check_same_system(card, dataset)
    folder = Path(out) if out is not None else run.results
    if folder is not None:
        check_folder(folder, EstimatorError)
        check_findings_place(run, folder)
    if windows < 1:
        raise EstimatorError(f"windows: is {windows}; expected at least 1")
    index = load_records(dataset, [])
    preset, length = card.noise if noise is None else noise, window_length(card, context_hours)
    absent = absent_channels(card, without or [])
    check_records(card, index, dataset.folder, length)
    seen = card.seen(dataset.manifest.system_hash, index)
    rows = {"paper": paper_rows(index, seen), "unseen": unseen_rows(index, seen)}
    if not len(rows["unseen"]):
        raise EstimatorError(
            f"{dataset.folder}: the run has trained on or been validated by all of its systems that count;"
            " expected at least one test system: simulate more, or another root seed"
        )
    hours = length * card.encoding.step / 3600
    channels = [name for name in card.encoding.channels if name not in (without or [])]
    limit, note = find_ceiling(  # before the work: the file may not be one
        card, dataset, None if ceiling is None else Path(ceiling), hours=hours, noise=preset, channels=channels
    )
    seeds = np.random.SeedSequence(seed).generate_state(2)
    drawn = {
        name: disjoint_windows(chosen, len(index.time), length, windows, np.random.default_rng(seeds[1]))
        for name, chosen in rows.items()
    }
    needed = np.unique(np.concatenate([where for where, _ in drawn.values()]))
    source = WindowSource(
        load_records(dataset, card.encoding.recorded, needed),
        card.encoding,
        Sensors(dataset.system, card.encoding.recorded, preset),
        torch.Generator().manual_seed(int(seeds[0])),
        lambda values, _: values.masked_fill(absent, torch.nan),
    )
    protocols: dict[str, Protocol] = {}
    answers: dict[str, Answers] = {}
    for name, (where, starts) in drawn.items():
        if name == "unseen" and np.array_equal(drawn["paper"], drawn["unseen"]):  # of a dataset that is all unseen
            protocols[name], answers[name] = protocols["paper"], answers["paper"]
            continue
        place = torch.from_numpy(np.searchsorted(needed, where))
        batch = source.gather(place, torch.from_numpy(starts), length)
        truth = index.parameters[where]
        estimate = run.estimates(run.answers(batch.windows, batch.time), length, without or [])
        protocols[name] = figures_of_merit(card.encoding.parameters, truth, estimate, where, seen)
        answers[name] = Answers(index.seeds[where], index.systems[where], batch.time.numpy(), truth, estimate)
    result = Evaluation(
        model=card.model,
        dataset=Kind.of(dataset, index),
        unfinished=cut_short,
        context_hours=hours,
        step=card.encoding.step,
        noise=preset,
        channels=channels,
        protocols=protocols,
        ceiling=limit,
        ceiling_note=note,
    )
    if folder is not None:
        if is_of(run, folder):
            check_not_replaced(run)
        make_folder(folder)
        write_report(result, card, folder, strata(answers["unseen"], card.encoding))
        write_answers(answers, card.encoding.parameters, folder)
        title = f"{card.model}, {hours:g} h, noise {preset}"
        clouds = {name: (one.truth, one.estimate, r2(one.truth, one.estimate)) for name, one in answers.items()}
        draw_scatter(clouds, card.encoding.parameters, card.encoding.parameter_units, title, folder / "scatter.png")
    return result


def paper_rows(records: Records, seen: np.ndarray) -> np.ndarray:
    """Rows of the systems for the protocol "paper": the full dataset.

    Where the run has trained on a part of the training systems only, the full dataset is that part, and as large a part
    of the others: otherwise most windows would be of systems that it never saw, which is the other protocol.
    """
    training = records.of_split("train")
    share = seen[training].mean() if len(training) else 0.0
    if share in (0.0, 1.0):
        return np.arange(len(records.systems))
    others = [records.of_split(split) for split in ("validation", "test")]
    kept = [rows[: max(1, round(share * len(rows)))] for rows in others]
    return np.sort(np.concatenate([training[seen[training]], *kept]))


def unseen_rows(records: Records, seen: np.ndarray) -> np.ndarray:
    """Rows of the systems for the protocol "unseen"; ``seen`` says of each row whether the run knows it.

    Where it knows none the dataset is not the training's: every system is unseen. Otherwise the test split counts, less
    what the run has seen after all.
    """
    if not seen.any():
        return np.arange(len(records.systems))
    test = records.of_split("test")
    return test[~seen[test]]


def figures_of_merit(
    parameters: list[str], truth: np.ndarray, estimate: np.ndarray, where: np.ndarray, seen: np.ndarray
) -> Protocol:
    """R2 with intervals by system, and median relative accuracy.

    ``truth`` and ``estimate`` are (windows, parameters), ``where`` the row of each window's system (windows,), ``seen``
    which rows the run knows (rows,).
    """

    def scores(rows: np.ndarray) -> np.ndarray:
        return r2_with_mean(truth[rows], estimate[rows])

    middle = scores(np.arange(len(truth)))
    low, high = r2_interval(where, scores, level=LEVEL)
    value = [float(v) if np.isfinite(v) else None for v in middle]
    spans = [tuple(float(v) if np.isfinite(v) else None for v in pair) for pair in zip(low, high, strict=True)]
    accuracy = np.median(relative_accuracy(truth, estimate), axis=0)
    unique = np.unique(where)
    return Protocol.model_validate(
        {
            "r2": dict(zip(parameters, value[:-1], strict=True)),
            "r2_mean": value[-1],
            "r2_interval": dict(zip(parameters, spans[:-1], strict=True)),
            "r2_mean_interval": spans[-1],
            "relative_accuracy": dict(zip(parameters, accuracy.tolist(), strict=True)),
            "windows": len(truth),
            "systems": len(unique),
            "systems_trained_on": int(seen[unique].sum()),
        }
    )


def check_same_system(card: Card, dataset: DatasetFolder) -> None:
    """Refuse a dataset of another system than the run's, or of another FMU.

    System hash, root seed and index say which systems the run has seen; with another FMU these are other systems.
    """
    if dataset.manifest.system_hash != card.system_hash:
        raise EstimatorError(
            f"{dataset.folder}: its system is {dataset.manifest.system_name} ({dataset.manifest.system_hash[:12]});"
            f" the run was trained on {card.system_name} ({card.system_hash[:12]})"
        )
    if dataset.manifest.fmu_sha256 != card.fmu_sha256:
        raise EstimatorError(
            f"{dataset.folder}: its fmu_sha256 is {dataset.manifest.fmu_sha256[:12]}; the run was trained on systems of"
            f" the FMU {card.fmu_sha256[:12]}: simulate the dataset with that one, or fit the estimator again"
        )


def window_length(card: Card, hours: float | None) -> int:
    """Samples of a window of so many hours, the run's main length by default."""
    hours = card.context_hours if hours is None else hours
    exact, known = hours * 3600 / card.encoding.step, card.encoding.lengths
    length = round(exact) if math.isfinite(exact) else 0
    if length not in known or abs(exact - length) > 1e-6:
        found = ", ".join(f"{one * card.encoding.step / 3600:g} h" for one in known)
        raise EstimatorError(f"context is {hours:g} h; the run was trained on {found}")
    return length


def absent_channels(card: Card, without: list[str]) -> torch.Tensor:
    """Which recorded channels are to be missing; bool (recorded,)."""
    for name in without:
        if name not in card.encoding.optional:
            found = ", ".join(card.encoding.optional) or "none"
            raise EstimatorError(f"without: {name!r} is not a channel that the run can do without; found {found}")
    return torch.tensor([name in without for name in card.encoding.recorded])


def check_records(card: Card, records: Records, folder: Path, length: int) -> None:
    """Refuse records of another step than the run's, or too short for windows of ``length`` samples."""
    step = float(records.time[1] - records.time[0]) if len(records.time) > 1 else card.encoding.step
    if abs(step - card.encoding.step) > 1e-6 * card.encoding.step:
        raise EstimatorError(f"{folder}: its step is {step:g} s; the run was trained on {card.encoding.step:g} s")
    if len(records.time) < length:
        raise EstimatorError(f"{folder}: its records have {len(records.time)} samples; the context is {length}")
