"""A multiscale transformer, and beside it regressions that are solved inside the network."""

from __future__ import annotations

from typing import Any, ClassVar

import torch
from torch import nn

from trainer.models.base import Shape
from trainer.models.multiscale_transformer import MultiscaleTransformer, silent
from trainer.models.regressions import MEMORY_HOURS, Regressions, memories


class RegressionTransformer(MultiscaleTransformer):
    """A :class:`MultiscaleTransformer` whose answer is corrected by what :class:`Regressions` find in the window.

    The correction begins at zero: with a multiscale transformer's weights it begins where that one ended.
    """

    space: ClassVar[dict[str, Any]] = {
        "patch": lambda trial, name, default: trial.suggest_categorical(name, sorted({6, 12, 24, default}))
    }
    """Of a search: a patch has at least as many samples as there are ``views``."""

    def __init__(
        self,
        shape: Shape,
        patch: int = 12,
        width: int = 128,
        layers: int = 4,
        heads: int = 8,
        feedforward: int = 384,
        dropout: float = 0.0,
        views: int = 6,
        regressions: int = 8,
        regressors: int = 12,
        responses: int = 3,
        filters: int = 64,
    ) -> None:
        super().__init__(shape, patch, width, layers, heads, feedforward, dropout, views)
        self.recorded, self.step = shape.recorded, shape.step
        columns = self.column_count + len(MEMORY_HOURS) * shape.recorded
        self.regressions = Regressions(columns, regressions, regressors, responses, filters)
        self.digest = nn.Sequential(
            nn.LayerNorm(self.regressions.size), nn.Linear(self.regressions.size, width), nn.GELU()
        )
        last = silent(width, shape.parameters)
        self.correction = nn.Sequential(nn.Linear(3 * width + shape.parameters, width), nn.GELU(), last)
        if shape.static:
            final = silent(2 * width, shape.parameters)
            inputs = 3 * width + shape.parameters + shape.static
            self.refinement = nn.Sequential(nn.Linear(inputs, 2 * width), nn.GELU(), final)

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        return self.answer_and_embed(windows, time)[0]

    def answer_and_embed(self, windows: torch.Tensor, time: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """See :class:`Estimator`."""
        static = windows[:, 0, windows.shape[2] - self.facts_count :]
        series, facts = self.apart(windows)
        windows = self.whole_patches(series)
        columns = self.columns(windows)
        past = memories(torch.nan_to_num(windows[:, :, : self.recorded]), self.step)
        digest = self.digest(self.regressions(torch.cat([columns, past], dim=2)))
        embedding = torch.cat([self.read(columns, facts), digest], dim=1)
        first = self.head(embedding[:, : -digest.shape[1]])
        answers = first + self.correction(torch.cat([embedding, first], dim=1))
        if self.facts_count:
            answers = answers + self.refinement(torch.cat([embedding, answers, static], dim=1))
        return answers, embedding
