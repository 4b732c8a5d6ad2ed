"""An MLP on summary statistics, added to the ridge on the same statistics."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import torch
from torch import nn

from trainer.models.base import SLOPE, Estimator, Recipe, Shape, initialise
from trainer.models.features import Summary
from trainer.models.ridge import CHUNK, fit_ridge
from trainer.reading.windows import Batch


class SummaryMlp(Estimator):
    """Ridge first, solved; then fully connected layers learn what it leaves.

    The MLP begins at zero, so that the estimator begins where the ridge ends, and with few systems stays near it.
    """

    recipe: ClassVar[Recipe] = Recipe(steps=3000, batch_size=128, lr=2e-3, schedule="cosine")
    slope: torch.Tensor
    offset: torch.Tensor

    def __init__(self, shape: Shape, width: int = 512, layers: int = 2, dropout: float = 0.3) -> None:
        super().__init__()
        self.summary = Summary(shape)
        self.register_buffer("slope", torch.zeros(self.summary.size, shape.parameters))
        self.register_buffer("offset", torch.zeros(shape.parameters))
        parts: list[nn.Module] = []
        size = self.summary.size
        for _ in range(layers):
            parts += [nn.Linear(size, width), nn.LeakyReLU(SLOPE), nn.Dropout(dropout)]
            size = width
        last = nn.Linear(size, shape.parameters)
        self.network = nn.Sequential(*parts, last)
        initialise(self)
        nn.init.zeros_(last.weight)

    def prepare(self, draw: Callable[[int], Batch], validation: Batch, windows: int) -> None:
        """Standardise the statistics and solve the ridge."""
        self.summary.prepare(draw(min(windows, 4 * CHUNK)))
        self.slope, self.offset = fit_ridge(self.summary, draw, validation, min(windows, 20 * CHUNK))

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        features = self.summary(windows, time)
        answer: torch.Tensor = features @ self.slope + self.offset + self.network(features)
        return answer
