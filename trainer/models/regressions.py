"""Linear regressions inside a network: what it regresses on what is learned, the coefficients are solved for.

Heat and mass balances are linear in what a building is made of once the right products and differences are formed: how
fast a temperature falls per degree of difference is a coefficient, not a shape. A transformer cannot solve normal
equations in a few layers; here they are solved exactly, window by window, and differentiated through (the "mesa layer"
of von Oswald et al. 2023, arXiv:2309.05858, is the same idea for sequences).
"""

from __future__ import annotations

import math

import torch
from torch import nn

MEMORY_HOURS = (3.0, 12.0, 48.0)
"""Time constants of the running means that stand for what walls remember [h]."""
FLOOR = 1e-7
"""Least variance of a regressor, response or residual, relative to what a standardised channel has."""
LEAST = 1e-9
"""Least weight of a sample, relative to the largest that it may have."""
LOG_PENALTY = -9.0
"""Logarithm of the first ridge penalty, relative to the regressors' variances."""
LIMIT = 8.0
"""Half width of what a statistic may be after asinh or a logarithm."""


class Regressions(nn.Module):
    """Weighted ridge regressions of learned responses on learned regressors, several side by side.

    Both are linear in a layer of local filters, each over ``reach`` samples, of the ``columns`` given to
    :meth:`forward`, and in products of pairs of such filters. Out come, of each of ``count`` regressions, the
    coefficients, their t-values, the residual variances and the variances' inflation. ``size`` is how many numbers that
    is.
    """

    def __init__(
        self,
        columns: int,
        count: int = 8,
        regressors: int = 12,
        responses: int = 3,
        filters: int = 64,
        reach: int = 5,
    ) -> None:
        super().__init__()
        self.count, self.regressors, self.responses, self.reach = count, regressors, responses, reach
        self.left = nn.Conv1d(columns, filters, reach)
        self.right = nn.Conv1d(columns, filters, reach)
        self.choice = nn.Linear(2 * filters, count * (regressors + responses))
        self.weight = nn.Linear(2 * filters, count)
        self.log_penalty = nn.Parameter(torch.full((count, 1), LOG_PENALTY))
        self.size = count * (2 * regressors * responses + responses + regressors)

    def forward(self, columns: torch.Tensor) -> torch.Tensor:
        """Statistics (batch, size) of columns (batch, length, columns) without missing values."""
        series = columns.transpose(1, 2)
        if series.shape[2] < self.reach:
            series = nn.functional.pad(series, (self.reach - series.shape[2], 0))
        left = self.left(series)
        local = torch.cat([left, left * self.right(series)], dim=1).transpose(1, 2)
        batch, length = local.shape[:2]
        weight = torch.sigmoid(self.weight(local)).clamp(min=LEAST)  # the root of zero has no gradient
        weight = weight / weight.sum(dim=1, keepdim=True)
        chosen = self.choice(local).view(batch, length, self.count, -1)
        centred = chosen - (weight[..., None] * chosen).sum(dim=1, keepdim=True)
        rows = (centred * weight.sqrt()[..., None]).permute(0, 2, 1, 3)
        return self._solve(rows.transpose(2, 3) @ rows)

    def _solve(self, moments: torch.Tensor) -> torch.Tensor:
        """Statistics from second moments (batch, count, regressors + responses, the same), in float64."""
        size = self.regressors
        moments = moments.double()
        gram, cross = moments[..., :size, :size], moments[..., :size, size:]
        total = torch.diagonal(moments[..., size:, size:], dim1=-2, dim2=-1)
        spread = (torch.diagonal(gram, dim1=-2, dim2=-1) + FLOOR).sqrt()
        eye = torch.eye(size, dtype=gram.dtype, device=gram.device)
        gram = gram / (spread[..., :, None] * spread[..., None, :]) + self.log_penalty.double().exp()[..., None] * eye
        cross = cross / spread[..., None]
        inverse = torch.cholesky_inverse(torch.linalg.cholesky(gram))
        slope = inverse @ cross
        # |y - X b|^2 = y'y - 2 b'X'y + b'X'X b; with the penalty's share left in it cannot become negative
        residual = (total - (slope * cross).sum(dim=-2)).clamp(min=0) + FLOOR
        inflation = torch.diagonal(inverse, dim1=-2, dim2=-1)
        ratio = slope / (inflation[..., None] * residual[..., None, :]).sqrt()
        parts = [torch.asinh(slope / spread[..., None]), torch.asinh(ratio), residual.log() / 2, inflation.log() / 2]
        return torch.cat([part.flatten(1) for part in parts], dim=1).clamp(-2 * LIMIT, 2 * LIMIT).float() / 2


def memories(series: torch.Tensor, step: float) -> torch.Tensor:
    """How far running means lie from a series: (batch, length, channels) to (batch, length, channels * memories).

    Means of the past with exponentially falling weights, begun at the window's own mean.
    """
    centred = series - series.mean(dim=1, keepdim=True)
    lag = torch.arange(series.shape[1], device=series.device)
    lag = lag[:, None] - lag[None, :]
    parts = []
    for hours in MEMORY_HOURS:
        keep = math.exp(-step / (3600 * hours))
        kernel = torch.where(lag >= 0, (1 - keep) * keep ** lag.clamp(min=0), torch.zeros((), device=series.device))
        parts.append(kernel @ centred - centred)
    return torch.cat(parts, dim=2)
