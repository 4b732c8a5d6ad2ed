"""The flow: p(parameters | window), in the space where the prior is standard normal.

What it is given of a window, its context, is the estimator's answer there, then whatever else tells posteriors apart.
It models the answer's error, in units of its spread over the fitting windows: an affine autoregressive transform, which
scales and correlates, and coupled neural splines, which bend (Durkan et al., 2019, Neural spline flows,
arXiv:1906.04032). Behind it comes a temperature that stretches the density about the flow's centre, for each parameter,
window length, and by whether an output is missing as a whole; it is the calibration's, not the training's.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import nn
from zuko.distributions import DiagNormal
from zuko.flows.autoregressive import MaskedAutoregressiveTransform
from zuko.lazy import Flow, UnconditionalDistribution
from zuko.transforms import MonotonicRQSTransform

FAR = 6.0
"""Context further than this many standard deviations from its mean is taken for this far: flows do not extrapolate."""
CHUNK = 8192
"""Samples drawn in one pass."""


class PosteriorFlow(nn.Module):
    """A conditional density of ``parameters`` numbers given ``context`` numbers, of which the first are the answer.

    So many ``lengths`` of windows have temperatures of their own. The last ``outputs`` numbers of the context are the
    share that is missing of an output.
    """

    context_mean: torch.Tensor
    context_sd: torch.Tensor
    error_mean: torch.Tensor
    error_sd: torch.Tensor
    log_temperature: torch.Tensor

    def __init__(
        self,
        parameters: int,
        context: int,
        lengths: int = 1,
        outputs: int = 0,
        summary: int = 32,
        width: int = 64,
        splines: int = 4,
        bins: int = 8,
        dropout: float = 0.1,
    ) -> None:
        super().__init__()
        self.parameters_count, self.outputs = parameters, outputs
        self.register_buffer("context_mean", torch.zeros(context))
        self.register_buffer("context_sd", torch.ones(context))
        self.register_buffer("error_mean", torch.zeros(parameters))
        self.register_buffer("error_sd", torch.ones(parameters))
        self.register_buffer("log_temperature", torch.zeros(lengths, 2, parameters))
        # once per window, however many samples are drawn of it
        self.summary = nn.Sequential(
            nn.Linear(context, 2 * width), nn.GELU(), nn.Dropout(dropout), nn.Linear(2 * width, summary)
        )
        order = torch.arange(parameters)
        mixed = torch.argsort(torch.cat([order[::2], order[1::2]]))
        orders = [order, order.flip(0), mixed, mixed.flip(0)]
        shape = {"features": parameters, "context": summary, "hidden_features": (width, width)}
        transforms = [MaskedAutoregressiveTransform(order=order, **shape)]
        # the splines couple one half of the parameters to the other: sampling takes two passes, not one per parameter
        transforms += [
            MaskedAutoregressiveTransform(
                order=orders[k % len(orders)],
                passes=2,
                univariate=MonotonicRQSTransform,
                shapes=[(bins,), (bins,), (bins - 1,)],
                **shape,
            )
            for k in range(splines)
        ]
        base = UnconditionalDistribution(DiagNormal, torch.zeros(parameters), torch.ones(parameters), buffer=True)
        self.flow = Flow(transforms, base)

    def standardise(self, context: torch.Tensor, z: torch.Tensor) -> None:
        """Take means and spreads from fitting windows: context (windows, context), truth z (windows, parameters)."""
        error = z - context[:, : self.parameters_count]
        for name, values in (("context", context), ("error", error)):
            sd = values.std(dim=0)
            getattr(self, f"{name}_mean").copy_(values.mean(dim=0))
            getattr(self, f"{name}_sd").copy_(torch.where(sd > 1e-6, sd, torch.ones_like(sd)))

    def lacking(self, context: torch.Tensor) -> torch.Tensor:
        """Which windows lack an output as a whole: 0 or 1, int64 (windows,)."""
        return (context[:, context.shape[1] - self.outputs :] == 1).any(dim=1).long()

    def _load_from_state_dict(self, state_dict: dict[str, Any], prefix: str, *others: Any) -> None:
        """Temperatures of the first version were one for both."""
        name = f"{prefix}log_temperature"
        if name in state_dict and state_dict[name].ndim == 2:
            state_dict[name] = state_dict[name][:, None].repeat(1, 2, 1)
        super()._load_from_state_dict(state_dict, prefix, *others)

    def summarise(self, context: torch.Tensor) -> torch.Tensor:
        """What the transforms are conditioned on (windows, summary)."""
        scaled = ((context - self.context_mean) / self.context_sd).clamp(-FAR, FAR)
        answer: torch.Tensor = self.summary(scaled)
        return answer

    def raw_log_prob(self, context: torch.Tensor, z: torch.Tensor, n: int = 1) -> torch.Tensor:
        """Log density (windows * n,) at z, before the temperatures: what is trained. z has n rows for each window."""
        answer, given = (
            part.repeat_interleave(n, dim=0) for part in (context[:, : self.parameters_count], self.summarise(context))
        )
        density: torch.Tensor = self.flow(given).log_prob((z - answer - self.error_mean) / self.error_sd)
        return density - self.error_sd.log().sum()

    def _back(self, context: torch.Tensor, summary: torch.Tensor, base: torch.Tensor) -> torch.Tensor:
        """Base numbers to z, both (windows, parameters), before the temperatures."""
        error: torch.Tensor = self.flow(summary).transform.inv(base)
        return context[:, : self.parameters_count] + self.error_mean + self.error_sd * error

    def centre(self, context: torch.Tensor) -> torch.Tensor:
        """Where the middle of the base goes: z (windows, parameters)."""
        return self._back(context, self.summarise(context), torch.zeros(len(context), self.parameters_count))

    def log_prob(self, context: torch.Tensor, z: torch.Tensor, length: int = 0) -> torch.Tensor:
        """Log density (windows, n) at z (windows, n, parameters), for windows of the ``length``-th length."""
        n, log_t = z.shape[1], self.log_temperature[length, self.lacking(context)][:, None]
        centre = self.centre(context)[:, None]
        raw = (centre + (z - centre) * torch.exp(-log_t)).reshape(-1, self.parameters_count)
        return self.raw_log_prob(context, raw, n).reshape(-1, n) - log_t.sum(dim=2)

    def sample(self, context: torch.Tensor, base: torch.Tensor, length: int = 0) -> torch.Tensor:
        """Samples z (windows, n, parameters) from base numbers of that shape, which should be standard normal."""
        windows, n, parameters = base.shape
        each = max(1, CHUNK // n)
        summary, centre, parts = self.summarise(context), self.centre(context)[:, None], []
        for begin in range(0, windows, each):
            here = slice(begin, begin + each)
            answer, given = (part[here].repeat_interleave(n, dim=0) for part in (context, summary))
            parts.append(self._back(answer, given, base[here].reshape(-1, parameters)).reshape(-1, n, parameters))
        temperature = self.log_temperature[length, self.lacking(context)].exp()[:, None]
        return centre + (torch.cat(parts) - centre) * temperature
