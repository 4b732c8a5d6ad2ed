"""Missing readings as augmentation: whole channels that a building does not measure, and gaps in those it does."""

from __future__ import annotations

import torch

from shared.errors import EstimatorError

WITHOUT = 0.5
"""Share of the windows that lack all optional channels; half of the others lack a random part of them."""
GAPS = 0.2
"""Share of the windows in which each output loses a stretch."""
LONGEST = 0.15
"""The longest gap, as a share of the window."""


class Missing:
    """Makes readings not a number: ``optional`` outputs, which a recording may lack, and stretches of any output.

    The first ``outputs`` of the channels ``recorded`` are outputs. Raises EstimatorError if an optional channel is not
    one of the outputs read, or all of them are optional.
    """

    def __init__(self, recorded: list[str], outputs: int, optional: list[str]) -> None:
        known = recorded[:outputs]
        for name in optional:
            if name not in known:
                raise EstimatorError(f"optional: {name!r} is not an output that is read; found {', '.join(known)}")
        if len(set(optional)) == len(known):
            raise EstimatorError("optional: all outputs are optional; expected at least one that is always there")
        self.outputs = outputs
        self.optional = torch.tensor([name in optional for name in known])

    def __call__(self, values: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """Windows (batch, length, recorded) with readings missing."""
        batch, length, _ = values.shape
        device = values.device

        def draws(*shape: int) -> torch.Tensor:
            return torch.rand(shape, generator=generator, device=device)

        draw, each = draws(batch, 1), draws(batch, self.outputs)
        lacks = self.optional.to(device) & ((draw < WITHOUT) | ((draw < (1 + WITHOUT) / 2) & (each < 0.5)))
        begin = draws(batch, 1, self.outputs) * length
        size = draws(batch, 1, self.outputs) * LONGEST * length
        place = torch.arange(length, device=device)[None, :, None]
        gap = (place >= begin) & (place < begin + size)
        gap &= draws(batch, 1, self.outputs) < GAPS
        lost = torch.zeros_like(values, dtype=torch.bool)
        lost[:, :, : self.outputs] = gap | lacks[:, None, :]
        return values.masked_fill(lost, torch.nan)
