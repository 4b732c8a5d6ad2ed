"""An MLP on summary statistics: the information lies in small deviations, and these statistics isolate it."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import torch
from torch import nn

from trainer.features import Summary
from trainer.models.base import SLOPE, Estimator, Recipe, Shape, initialise
from trainer.windows import Batch


class SummaryMlp(Estimator):
    """Standardised statistics of the window, then fully connected layers."""

    recipe: ClassVar[Recipe] = Recipe(steps=4000, batch_size=128, lr=1e-3, schedule="cosine")

    def __init__(self, shape: Shape, width: int = 256, layers: int = 3, dropout: float = 0.1) -> None:
        super().__init__()
        self.summary = Summary(shape)
        parts: list[nn.Module] = []
        size = self.summary.size
        for _ in range(layers):
            parts += [nn.Linear(size, width), nn.LeakyReLU(SLOPE), nn.Dropout(dropout)]
            size = width
        self.network = nn.Sequential(*parts, nn.Linear(size, shape.parameters))
        initialise(self)

    def prepare(self, draw: Callable[[int], Batch], validation: Batch, windows: int) -> None:
        """Learn how the statistics are standardised."""
        self.summary.prepare(draw(4096))

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        answer: torch.Tensor = self.network(self.summary(windows, time))
        return answer
