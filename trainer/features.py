"""Summary statistics of a window: a fixed, differentiable map from windows to numbers, standardised.

Raw windows are mostly signal that all systems share: set points, the diurnal cycle, the weather. Statistics by hour of
day, of differences, and of products at lags set the systems apart. Only recorded channels enter; the clock sorts the
samples by hour of day and by day of week.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import nn

from trainer.encoding import DAY
from trainer.models.base import Shape
from trainer.windows import Batch

LAG_HOURS = (1, 2, 3, 4, 6, 8, 12, 18, 24, 36, 48, 72)
QUANTILES = (0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
SMALL = 1e-3
"""Added to spreads before the logarithm [standard deviations of the channel]."""
LIMIT = 8.0
"""Standardised statistics are clipped here: what lies further out was not trained on."""


class Summary(nn.Module):
    """Statistics of windows, standardised by those seen in :meth:`prepare`. ``size`` is their number."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        per_hour = 3600.0 / shape.step
        lags = sorted({max(1, round(hours * per_hour)) for hours in LAG_HOURS})
        self.lags = [lag for lag in lags if lag <= shape.length // 2]
        self.bins = max(1, min(24, int(DAY // shape.step)))
        probe = torch.zeros(1, shape.length, shape.columns)
        self.size = sum(part.shape[1] for part in self._parts(probe, torch.zeros(1, dtype=torch.float64)))
        self.register_buffer("mean", torch.zeros(self.size))
        self.register_buffer("sd", torch.ones(self.size))

    def prepare(self, batch: Batch) -> None:
        """Learn mean and standard deviation of the statistics from training windows."""
        with torch.no_grad():
            raw = torch.cat(list(self._parts(batch.windows, batch.time)), dim=1).double()
            sd = raw.std(dim=0, correction=0)
            self.mean = raw.mean(dim=0).float()
            self.sd = torch.where(sd > 1e-6, sd, torch.ones_like(sd)).float()

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """Standardised statistics (batch, size) of windows (batch, length, columns) with first stamps (batch,) [s]."""
        raw = torch.cat(list(self._parts(windows, time)), dim=1)
        return torch.clamp((raw - self.mean) / self.sd, -LIMIT, LIMIT)

    def _parts(self, windows: torch.Tensor, time: torch.Tensor) -> Iterator[torch.Tensor]:
        series = windows[:, :, : self.shape.recorded]
        if series.shape[1] < 2:
            yield series.flatten(1)
            return
        steps = series.diff(dim=1)
        yield from _moments(series)
        yield from _moments(steps)
        yield from self._lagged(series, steps)
        yield from self._by_hour(series, steps, time)

    def _lagged(self, series: torch.Tensor, steps: torch.Tensor) -> Iterator[torch.Tensor]:
        """Correlations of channels and of their differences at lags, both ways round."""
        for one in (series, steps):
            centred = one - one.mean(dim=1, keepdim=True)
            scaled = centred / (centred.square().mean(dim=1, keepdim=True).sqrt() + SMALL)
            length, channels = scaled.shape[1:]
            if channels > 1:
                upper = torch.triu_indices(channels, channels, 1)
                yield (scaled.transpose(1, 2) @ scaled / length)[:, upper[0], upper[1]]
            for lag in self.lags:
                yield (scaled[:, :-lag].transpose(1, 2) @ scaled[:, lag:] / length).flatten(1)

    def _by_hour(self, series: torch.Tensor, steps: torch.Tensor, time: torch.Tensor) -> Iterator[torch.Tensor]:
        """Profiles over the hour of day: levels and differences, their spread, and the levels of weekends."""
        length = series.shape[1]
        # a stamp is the end of its step: half a step earlier lies inside the hour that it reports on
        middle = time[:, None] + self.shape.step * (torch.arange(length, dtype=torch.float64) - 0.5)
        hour = (torch.remainder(middle, DAY) * (self.bins / DAY)).long().clamp(max=self.bins - 1)
        member = nn.functional.one_hot(hour, self.bins).to(series.dtype).transpose(1, 2)  # (batch, bins, length)
        weekend = (torch.remainder(middle, 7 * DAY) >= 5 * DAY).to(series.dtype)[:, None, :]
        level, spread = _profile(member, series)
        yield level.flatten(1)
        yield torch.log(spread + SMALL).flatten(1)
        slope, shake = _profile(member[:, :, 1:], steps)
        yield slope.flatten(1)
        yield torch.log(shake + SMALL).flatten(1)
        free = member * weekend
        seen = (free.sum(dim=2, keepdim=True) > 0).to(series.dtype)
        yield ((_profile(free, series)[0] - level) * seen).flatten(1)
        yield seen.flatten(1)
        phase = torch.remainder(time, 7 * DAY) * (2 * torch.pi / (7 * DAY))
        yield torch.stack([torch.sin(phase), torch.cos(phase)], dim=1).to(series.dtype)


def _moments(series: torch.Tensor) -> Iterator[torch.Tensor]:
    """Mean, logarithm of the spread, and quantiles of each channel."""
    yield series.mean(dim=1)
    yield torch.log(series.std(dim=1, correction=0) + SMALL)
    yield torch.quantile(series, torch.tensor(QUANTILES), dim=1).transpose(0, 1).flatten(1)


def _profile(member: torch.Tensor, series: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean and spread of each channel in each bin; zero where a bin is empty.

    ``member`` (batch, bins, length) says which sample is in which bin, ``series`` is (batch, length, channels).
    """
    count = member.sum(dim=2, keepdim=True).clamp(min=1)
    mean = member @ series / count
    square = member @ series.square() / count
    return mean, (square - mean.square()).clamp(min=0).sqrt()
