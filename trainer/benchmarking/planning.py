"""What a benchmark is going to do: which fits, where, and how long it will take."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import xarray as xr

from shared.ceiling import FILE_NAME, read_ceilings
from shared.errors import EstimatorError
from shared.reading import read_json, shown
from shared.store import DatasetFolder
from trainer.benchmarking.conditions import Budget, Condition, Fit
from trainer.benchmarking.job import is_done, read_done
from trainer.benchmarking.parts import Ground, Part, make_parts
from trainer.models import estimator_class
from trainer.reading.data import difference, digest_of, identity_of, load_records, rows_of
from trainer.runs.checkpoint import CARD, read_card
from trainer.runs.versions import other_version

OURS = ("multiscale-transformer",)
"""Estimators that stand beside the paper's, unless the user names others."""
IDENTITY = "benchmark.json"


@dataclass
class Plan:
    """What a benchmark is going to do."""

    dataset: Path
    out: Path
    parts: list[Part]
    seeds: int
    budget: Budget
    windows: int
    workers: int
    ceiling: Path | None
    identity: dict[str, Any]
    """which dataset this is"""
    data: str
    """its fingerprint"""
    training: int
    fits: list[Fit] = field(default_factory=list)

    def folder(self, fit: Fit) -> Path:
        """Run folder of a fit."""
        return self.out / "fits" / fit.key()

    def fit_of(self, condition: Condition, seed: int) -> Fit:
        """The fit of a condition with a seed."""
        return Fit(condition=condition, seed=seed, budget=self.budget, windows=self.windows)

    def is_done(self, fit: Fit) -> bool:
        """Whether a fit is finished, and what its folder holds is its own."""
        return is_done(self.folder(fit), fit, self.data)

    def left(self) -> list[Fit]:
        """Fits that are not finished."""
        return [fit for fit in self.fits if not self.is_done(fit)]

    def overheads(self) -> list[float]:
        """What finished fits took beside their budget [s]: reading, solving, scoring."""
        budget = 60 * (self.budget.minutes or 0)
        found = []
        for fit in self.fits:
            if self.is_done(fit):
                done = read_done(self.folder(fit))
                iterates = estimator_class(fit.condition.model).iterates
                found.append(max(0.0, done.seconds - (budget if iterates else 0)))
        return found

    def minutes_left(self) -> tuple[float | None, bool]:
        """Minutes that the fits left will take, None where unknown; and whether what is beside training is in them."""
        left = self.left()
        iterating = sum(estimator_class(fit.condition.model).iterates for fit in left)
        overheads = self.overheads()
        beside = sum(overheads) / len(overheads) / 60 * len(left) if overheads else 0.0
        if self.budget.minutes is None:
            return (beside / self.workers, True) if overheads else (None, False)
        return (iterating * self.budget.minutes + beside) / self.workers, bool(overheads)


def make_plan(
    dataset_dir: Path | str | xr.Dataset,
    out: Path | str,
    *,
    minutes: float | None = None,
    steps: int | None = None,
    seeds: int = 3,
    parts: list[str] | None = None,
    ours: list[str] | None = None,
    windows: int = 1000,
    workers: int = 1,
    ceiling: Path | None = None,
) -> Plan:
    """The fits of a benchmark; arguments as for :func:`benchmark`.

    Raises EstimatorError if an argument is wrong, or ``out`` belongs to another dataset or has fits of other versions;
    DatasetError if the dataset cannot be used; ZeroshotError if the file of ceilings cannot be.
    """
    for name, value in (("seeds", seeds), ("windows", windows), ("workers", workers)):
        if value < 1:
            raise EstimatorError(f"{name}: is {value}; expected at least 1")
    if minutes is not None and steps is not None:
        raise EstimatorError("steps and minutes: both are given; expected one budget")
    for name, budget_given in (("minutes", minutes), ("steps", steps)):
        if budget_given is not None and not 0 < budget_given < math.inf:
            raise EstimatorError(f"{name}: is {budget_given:g}; expected a positive number")
    for model in ours or []:
        estimator_class(model)
    dataset = DatasetFolder(dataset_dir)
    limits = dataset.folder / FILE_NAME if ceiling is None else ceiling
    if ceiling is not None or limits.exists():
        read_ceilings(limits)  # before hours of work, not after
    index = load_records(dataset, [])
    training = len(rows_of(index, "train", dataset.folder))
    step = float(index.time[1] - index.time[0]) if len(index.time) > 1 else dataset.system.experiment.step
    ground = Ground(
        dataset.system, len(index.time) * step / 3600, step, training, tuple(OURS if ours is None else ours)
    )
    budget = Budget(minutes=3.0 if minutes is None and steps is None else minutes, steps=steps)
    identity = identity_of(dataset, index)
    plan = Plan(
        dataset=dataset.folder,
        out=Path(out),
        parts=make_parts(ground, parts),
        seeds=seeds,
        budget=budget,
        windows=windows,
        workers=workers,
        ceiling=ceiling,
        identity=identity | {"hours": ground.hours, "step": step},
        data=digest_of(identity),
        training=training,
    )
    conditions = list(dict.fromkeys(row.condition for part in plan.parts for row in part.rows))
    # one seed of everything first: a benchmark that is stopped early has whole tables
    plan.fits = [plan.fit_of(condition, seed) for seed in range(seeds) for condition in conditions]
    _check_identity(plan)
    for fit in plan.fits:
        _check_versions(plan.folder(fit) / CARD)
    return plan


def _check_identity(plan: Plan) -> None:
    path = plan.out / IDENTITY
    if not path.exists():
        return
    found = read_json(path, EstimatorError, "what `trainer benchmark` wrote; choose another folder")
    if not isinstance(found, dict):
        raise EstimatorError(f"{path}: is {shown(found)}; expected a table; choose another folder")
    other = difference(found, plan.identity)
    if other is not None:
        raise EstimatorError(
            f"{plan.out}: does not hold a benchmark of this very dataset: {other}; choose another folder"
        )


def _check_versions(path: Path) -> None:
    """Refuse a fit of other versions: beside those of this one it would be compared with them in one table."""
    try:
        found = read_card(path.parent).versions
    except EstimatorError:  # none is there; of one that is damaged its fit says so
        return
    if other := other_version(found):
        name, theirs, ours = other
        raise EstimatorError(
            f"{path}: versions: {name} is {theirs}; expected {ours}, as here: choose another folder, go on"
            " with the versions that began this one, or remove what they fitted"
        )
