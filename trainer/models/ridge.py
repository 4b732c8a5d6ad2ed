"""Ridge regression on summary statistics: what a linear model would say."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
import torch

from trainer.models.base import Estimator, Recipe, Shape
from trainer.models.features import Summary
from trainer.reading.windows import Batch

ALPHAS = np.logspace(-6, 1, 15)
"""Penalties tried, per window seen."""
CHUNK = 1024


class Ridge(Estimator):
    """A linear map from standardised statistics to targets; each target's penalty is chosen on validation systems."""

    recipe: ClassVar[Recipe] = Recipe(steps=20, batch_size=CHUNK)
    iterates: ClassVar[bool] = False
    slope: torch.Tensor
    offset: torch.Tensor

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.summary = Summary(shape)
        self.register_buffer("slope", torch.zeros(self.summary.size, shape.parameters))
        self.register_buffer("offset", torch.zeros(shape.parameters))

    def prepare(self, draw: Callable[[int], Batch], validation: Batch, windows: int) -> None:
        """Solve for the coefficients: the whole training."""
        self.summary.prepare(draw(min(windows, 4 * CHUNK)))
        self.slope, self.offset = fit_ridge(self.summary, draw, validation, windows)

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        return self.summary(windows, time) @ self.slope + self.offset


def fit_ridge(
    summary: Summary, draw: Callable[[int], Batch], validation: Batch, windows: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Slope (statistics, targets) and offset (targets,), from so many training windows.

    The normal equations are added up in float64, solved for every penalty, and the best on the validation windows kept.
    """
    size = summary.size + 1  # the last column is the intercept, which is not penalised
    gram, moment, seen = np.zeros((size, size)), np.zeros((size, validation.targets.shape[1])), 0
    while seen < windows:
        batch = draw(min(CHUNK, windows - seen))
        rows = _design(summary, batch)
        gram += rows.T @ rows
        moment += rows.T @ batch.targets.double().numpy()
        seen += len(rows)
    solutions = solve_ridge(gram / seen, moment / seen, ALPHAS)
    errors = np.mean((_design(summary, validation) @ solutions - validation.targets.double().numpy()) ** 2, axis=1)
    best = solutions[errors.argmin(axis=0), :, np.arange(moment.shape[1])].T.astype(np.float32)
    return torch.from_numpy(best[:-1].copy()), torch.from_numpy(best[-1].copy())


def _design(summary: Summary, batch: Batch) -> np.ndarray:
    with torch.no_grad():
        features = summary(batch.windows, batch.time).double().numpy()
    return np.concatenate([features, np.ones((len(features), 1))], axis=1)


def solve_ridge(gram: np.ndarray, moment: np.ndarray, alphas: np.ndarray) -> np.ndarray:
    """Coefficients that minimise |X b - y|^2 / n + alpha |b|^2, the last coefficient unpenalised, for each alpha.

    ``gram`` is X'X / n (features + 1, features + 1) and ``moment`` X'y / n (features + 1, targets); the last column of
    X is ones. Their shape is (alphas, features + 1, targets).
    """
    mean, target = gram[-1, :-1], moment[-1]
    # one eigendecomposition of the centred problem serves every penalty
    values, vectors = np.linalg.eigh(gram[:-1, :-1] - np.outer(mean, mean))
    projected = vectors.T @ (moment[:-1] - np.outer(mean, target))
    answers = []
    for alpha in alphas:
        slope = vectors @ (projected / (np.maximum(values, 0) + alpha)[:, None])
        answers.append(np.concatenate([slope, (target - mean @ slope)[None]], axis=0))
    return np.stack(answers)
