"""Temporal convolutional network (Lea et al. 2017), at about the patch transformer's number of weights."""

from __future__ import annotations

import torch
from torch import nn

from trainer.models.base import SLOPE, Estimator, Shape, initialise, regression_head


class _Block(nn.Module):
    """Two dilated causal convolutions beside a residual path."""

    def __init__(self, columns: int, width: int, kernel: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.pad = nn.ConstantPad1d(((kernel - 1) * dilation, 0), 0.0)
        self.first = nn.Conv1d(columns, width, kernel, dilation=dilation)
        self.second = nn.Conv1d(width, width, kernel, dilation=dilation)
        self.same = nn.Conv1d(columns, width, 1) if columns != width else nn.Identity()
        self.activation = nn.LeakyReLU(SLOPE)
        self.dropout = nn.Dropout(dropout)

    def forward(self, series: torch.Tensor) -> torch.Tensor:
        inner = self.dropout(self.activation(self.first(self.pad(series))))
        inner = self.dropout(self.activation(self.second(self.pad(inner))))
        answer: torch.Tensor = self.activation(inner + self.same(series))
        return answer


class Tcn(Estimator):
    """Blocks with dilations 1, 2, 4, ... until the last sample sees the whole window; it goes to the head."""

    def __init__(self, shape: Shape, width: int = 72, kernel: int = 3, dropout: float = 0.2) -> None:
        super().__init__()
        blocks: list[nn.Module] = []
        seen, dilation, columns = 1, 1, shape.columns
        while seen < shape.length or not blocks:
            blocks.append(_Block(columns, width, kernel, dilation, dropout))
            seen += 2 * (kernel - 1) * dilation
            dilation, columns = 2 * dilation, width
            if kernel == 1:  # sees one sample whatever the dilation
                break
        self.blocks = nn.Sequential(*blocks)
        self.head = regression_head(width, shape.parameters)
        initialise(self)

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        answer: torch.Tensor = self.head(self.blocks(windows.transpose(1, 2))[:, :, -1])
        return answer
