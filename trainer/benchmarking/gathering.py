"""The finished fits of a condition: mean and spread over seeds, intervals by system."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shared.errors import EstimatorError
from shared.metrics import relative_accuracy
from shared.reading import read_json, validated
from shared.store import DatasetFolder
from trainer.benchmarking.conditions import Condition
from trainer.benchmarking.job import FAILED, read_done
from trainer.benchmarking.planning import Plan
from trainer.evaluating.evaluation import LEVEL
from trainer.evaluating.limit import find_ceiling
from trainer.evaluating.report import EVALUATION, Answers, CeilingFigures, Evaluation, read_answers
from trainer.intervals import r2_interval, r2_with_mean
from trainer.runs.checkpoint import Training, read_card


@dataclass(frozen=True)
class Scores:
    """One protocol. The last column of ``r2`` and the last number of ``low`` and ``high`` are the mean over parameters.

    ``r2`` (seeds, parameters + 1); ``low`` and ``high`` (parameters + 1,): 90 % interval, by system, of the mean over
    seeds; ``accuracy`` (parameters + 1,): median relative accuracy.
    """

    r2: np.ndarray
    low: np.ndarray
    high: np.ndarray
    accuracy: np.ndarray
    windows: int
    systems: int
    trained_on: int

    @property
    def mean(self) -> np.ndarray:
        """Over seeds (parameters + 1,)."""
        mean: np.ndarray = self.r2.mean(axis=0)
        return mean

    @property
    def sd(self) -> np.ndarray:
        """Spread over seeds (parameters + 1,); not a number where there is one."""
        if len(self.r2) < 2:
            return np.full(self.r2.shape[1], np.nan)
        sd: np.ndarray = self.r2.std(axis=0, ddof=1)
        return sd


@dataclass(frozen=True)
class Finding:
    """What is known of a condition."""

    condition: Condition
    parameters: list[str]
    units: list[str]
    protocols: dict[str, Scores]
    ceiling: CeilingFigures | None
    ceiling_note: str
    trainings: list[Training]
    training_systems: int
    warnings: list[str]
    folders: list[Path]
    """run folders of the seeds that are finished, in their order"""

    def limit(self, k: int) -> float | None:
        """Ceiling of parameter ``k``; of the mean over parameters where ``k`` is -1."""
        if self.ceiling is None:
            return None
        return self.ceiling.r2_mean if k == -1 else self.ceiling.r2.get(self.parameters[k])


def read_evaluation(folder: Path) -> Evaluation:
    """``evaluation.json`` of a run folder."""
    path, expected = folder / EVALUATION, "a file of `trainer evaluate`"
    return validated(Evaluation, read_json(path, EstimatorError, expected), f"{path}", EstimatorError, expected)


def gather(plan: Plan, condition: Condition) -> Finding | None:
    """The finding of a condition over the seeds that are finished; None where none is."""
    fits = [plan.fit_of(condition, seed) for seed in range(plan.seeds)]
    folders = [plan.folder(fit) for fit in fits if plan.is_done(fit)]
    if not folders:
        return None
    cards = [read_card(folder) for folder in folders]
    evaluation = read_evaluation(folders[0])
    limit, note = find_ceiling(  # the ceiling of today: the file may have come, or another been named, since the fit
        *(cards[0], DatasetFolder(plan.dataset), plan.ceiling),
        hours=evaluation.context_hours,
        noise=evaluation.noise,
        channels=evaluation.channels,
    )
    answers = [read_answers(folder) for folder in folders]
    done = [read_done(folder) for folder in folders]
    protocols = {
        name: scores_of([one[name] for one in answers], evaluation.protocols[name].systems_trained_on)
        for name in answers[0]
    }
    return Finding(
        condition=condition,
        parameters=cards[0].encoding.parameters,
        units=cards[0].encoding.parameter_units,
        protocols=protocols,
        ceiling=limit,
        ceiling_note=note,
        trainings=[card.training for card in cards],
        training_systems=len(cards[0].training_systems.indices),
        warnings=[one.warning for one in done if one.warning],
        folders=folders,
    )


def scores_of(answers: list[Answers], trained_on: int) -> Scores:
    """Scores of the seeds' answers to the same windows; for the interval systems, never windows, are left out."""
    systems = answers[0].places()

    def of_seed(one: Answers, rows: np.ndarray) -> np.ndarray:
        return r2_with_mean(one.truth[rows], one.estimate[rows])

    def over_seeds(rows: np.ndarray) -> np.ndarray:
        mean: np.ndarray = np.mean([of_seed(one, rows) for one in answers], axis=0)
        return mean

    everything = np.arange(len(systems))
    low, high = r2_interval(systems, over_seeds, level=LEVEL)
    accuracy = np.concatenate([relative_accuracy(one.truth, one.estimate) for one in answers])
    return Scores(
        r2=np.stack([of_seed(one, everything) for one in answers]),
        low=low,
        high=high,
        accuracy=np.append(np.median(accuracy, axis=0), np.median(accuracy)),
        windows=len(systems),
        systems=len(np.unique(systems)),
        trained_on=trained_on,
    )


def failures(plan: Plan) -> list[str]:
    """Sentences on fits that failed."""
    found = []
    for fit in plan.fits:
        path = plan.folder(fit) / FAILED
        if path.exists():
            why = path.read_text(encoding="utf-8", errors="replace").strip()
            # the page goes to other people: where it was written is nothing to them
            found.append(f"{fit.title()}: {why.replace(f'{plan.out}{os.sep}', '')}")
    return found
