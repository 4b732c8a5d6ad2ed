"""Summary statistics of a window: a fixed, differentiable map from windows to numbers, standardised.

Raw windows are mostly signal that all systems share: set points, the diurnal cycle, the weather. What sets systems
apart is how they answer it: statistics of differences, of products at lags, by hour of day, and the coefficients of a
linear model of each output's next step, fitted to the window. Only recorded channels enter; the clock sorts the samples
by hour of day and by day of week.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import nn

from trainer.models.base import Shape
from trainer.reading.encoding import DAY
from trainer.reading.windows import Batch

LAG_HOURS = (1, 2, 3, 4, 6, 8, 12, 18, 24, 36, 48, 72)
QUANTILES = (0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
ORDER = 2
"""Steps back that the linear model sees; its step is an hour, or the sampling step where that is longer."""
HARMONICS = 2
"""Of the day, in the linear model: they stand for what follows a timetable and is not recorded."""
PENALTY = 1e-3
"""On the linear model's coefficients: keeps constant or collinear channels harmless."""
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
        self.hop = max(1, round(per_hour))
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
        if self.shape.static:
            yield windows[:, 0, windows.shape[2] - self.shape.static :]
        yield from self._lagged(series, steps)
        yield from self._by_hour(series, steps, time)
        if self.shape.outputs and series.shape[1] >= 2 * ORDER * self.hop + 2:
            yield from self._dynamics(series, time)

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

    def _middle(self, time: torch.Tensor, length: int) -> torch.Tensor:
        """A moment of each sample (batch, length) [s]: half a step before its stamp, inside the hour it reports on."""
        return time[:, None] + self.shape.step * (torch.arange(length, dtype=torch.float64, device=time.device) - 0.5)

    def _member(self, middle: torch.Tensor) -> torch.Tensor:
        """Which sample lies in which bin of the day, 0 or 1 (batch, bins, length)."""
        hour = (torch.remainder(middle, DAY) * (self.bins / DAY)).long().clamp(max=self.bins - 1)
        return nn.functional.one_hot(hour, self.bins).float().transpose(1, 2)

    def _dynamics(self, series: torch.Tensor, time: torch.Tensor) -> Iterator[torch.Tensor]:
        """The linear model's coefficients, the spread of what it leaves, and the profile of that over the hour of day.

        Each output's change over a step is regressed, window by window, on all channels at the last steps, the inputs
        now, a constant and the harmonics of the day.
        """
        hop, outputs = self.hop, self.shape.outputs
        length = series.shape[1] - ORDER * hop
        past = [series[:, (ORDER - k) * hop : (ORDER - k) * hop + length] for k in range(1, ORDER + 1)]
        now = series[:, ORDER * hop :]
        middle = self._middle(time, series.shape[1])[:, ORDER * hop :]
        angle = (
            torch.remainder(middle, DAY)[:, :, None]
            * (2 * torch.pi / DAY)
            * torch.arange(1, HARMONICS + 1, device=middle.device)
        )
        clock = torch.cat([torch.sin(angle), torch.cos(angle)], dim=2)
        rows = torch.cat([*past, now[:, :, outputs:], clock, torch.ones_like(clock[:, :, :1])], dim=2).double()
        change = (now - past[0])[:, :, :outputs].double()
        gram = rows.transpose(1, 2) @ rows / length + PENALTY * torch.eye(
            rows.shape[2], dtype=torch.float64, device=rows.device
        )
        coefficients = torch.linalg.solve(gram, rows.transpose(1, 2) @ change / length)
        left = (change - rows @ coefficients).to(series.dtype)
        yield coefficients.to(series.dtype).flatten(1)
        yield torch.log(left.std(dim=1, correction=0) + SMALL)
        yield _profile(self._member(middle), left)[0].flatten(1)

    def _by_hour(self, series: torch.Tensor, steps: torch.Tensor, time: torch.Tensor) -> Iterator[torch.Tensor]:
        """Profiles over the hour of day: levels and differences, their spread, and the levels of weekends."""
        middle = self._middle(time, series.shape[1])
        member = self._member(middle)
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
    yield torch.quantile(series, torch.tensor(QUANTILES, device=series.device), dim=1).transpose(0, 1).flatten(1)


def _profile(member: torch.Tensor, series: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean and spread of each channel in each bin; zero where a bin is empty.

    ``member`` (batch, bins, length) says which sample is in which bin, ``series`` is (batch, length, channels).
    """
    count = member.sum(dim=2, keepdim=True).clamp(min=1)
    mean = member @ series / count
    square = member @ series.square() / count
    return mean, (square - mean.square()).clamp(min=0).sqrt()
