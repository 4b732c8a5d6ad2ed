"""LSTM baseline (Hochreiter and Schmidhuber 1997), at about the patch transformer's number of weights."""

from __future__ import annotations

import torch
from torch import nn

from trainer.models.base import Estimator, Shape, initialise, regression_head


class Lstm(Estimator):
    """A stack of LSTM layers; the last hidden state goes to the same head as the patch transformer's."""

    def __init__(self, shape: Shape, width: int = 112, layers: int = 2, dropout: float = 0.2) -> None:
        super().__init__()
        between = dropout if layers > 1 else 0.0
        self.recurrent = nn.LSTM(shape.columns, width, layers, batch_first=True, dropout=between)
        self.head = regression_head(width, shape.parameters)
        initialise(self)

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        _, (hidden, _) = self.recurrent(windows)
        answer: torch.Tensor = self.head(hidden[-1])
        return answer
