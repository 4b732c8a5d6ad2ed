"""A patch transformer that reads its outputs at several scales.

What sets systems apart are small deviations under a large common signal: how CO2 settles in the last per cent, how the
temperature bends in an hour. So each output is also given as differences, and through asinh at several scales, which
magnifies what is small and keeps what is large. Missing readings (not a number) are zero with a flag. Any context that
is at most the trained one is read; patches are counted from its end.
"""

from __future__ import annotations

from typing import ClassVar

import torch
from torch import nn
from torch.nn.attention import SDPBackend, sdpa_kernel

from shared.errors import EstimatorError, OptionsError
from trainer.models.base import Estimator, Recipe, Shape

LEVEL_SCALES = (1e-3, 1e-2, 1e-1)
"""Of deviations from the window's low quantile [standard deviations of the channel]."""
STEP_SCALES = (1e-3, 1e-2)
"""Of differences between samples [standard deviations of the channel]."""
LOW = 0.02
"""The quantile that deviations are counted from: most outputs rest at their lower end."""
GAIN = 0.25
"""Brings asinh of large ratios back to the size of the other columns."""


class MultiscaleTransformer(Estimator):
    """Patches of multi-scale columns through an MLP, a pre-norm transformer encoder, mean and maximum, an MLP head."""

    recipe: ClassVar[Recipe] = Recipe(steps=20000, batch_size=128, lr=1e-3, schedule="cosine", optimiser="muon")
    reads_missing: ClassVar[bool] = True
    reads_shorter: ClassVar[bool] = True
    rounds: ClassVar[bool] = True
    means: ClassVar[bool] = True

    def __init__(
        self,
        shape: Shape,
        patch: int = 12,
        width: int = 128,
        layers: int = 4,
        heads: int = 8,
        feedforward: int = 384,
        dropout: float = 0.0,
        views: int = 1,
    ) -> None:
        super().__init__()
        if patch > shape.length:
            raise OptionsError(f"patch is {patch} samples; expected no more than the {shape.length} of the context")
        if width % heads:
            raise OptionsError(f"width is {width}; expected a multiple of the {heads} attention heads")
        if views > patch:
            raise OptionsError(f"views is {views}; expected no more than the {patch} samples of a patch")
        self.outputs, self.patch, self.tokens = shape.outputs, patch, shape.length // patch
        self.shifts = [patch * k // views for k in range(views)]
        self.facts_count = shape.static
        self.column_count = shape.columns - shape.static + shape.outputs * (2 + len(LEVEL_SCALES) + len(STEP_SCALES))
        self.embedding = nn.Sequential(
            nn.Linear(patch * self.column_count, 2 * width), nn.GELU(), nn.Linear(2 * width, width)
        )
        self.position = nn.Parameter(0.02 * torch.randn(self.tokens, width))
        if shape.static:
            self.facts = nn.Sequential(nn.Linear(shape.static, width), nn.GELU(), silent(width, width))
        layer = nn.TransformerEncoderLayer(
            width, heads, feedforward, dropout, activation="gelu", batch_first=True, norm_first=True
        )
        self.encoder = nn.TransformerEncoder(layer, layers, enable_nested_tensor=False)
        self.norm = nn.LayerNorm(2 * width)
        self.head = nn.Sequential(nn.Linear(2 * width, 2 * width), nn.GELU(), nn.Linear(2 * width, shape.parameters))

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        answer: torch.Tensor = self.head(self.embed(windows))
        return answer

    def answer_and_embed(self, windows: torch.Tensor, time: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """See :class:`Estimator`."""
        embedding = self.embed(windows)
        return self.head(embedding), embedding

    def embed(self, windows: torch.Tensor) -> torch.Tensor:
        """What the encoder makes of a window (batch, 2 width)."""
        series, facts = self.apart(windows)
        return self.read(self.columns(self.whole_patches(series)), facts)

    def apart(self, windows: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The series of windows, and their facts as they are added to each patch (batch, width), or none."""
        if not self.facts_count:
            return windows, windows[:, 0, :0]
        series, static = windows[:, :, : -self.facts_count], windows[:, 0, -self.facts_count :]
        return series, self.facts(static)

    def whole_patches(self, windows: torch.Tensor) -> torch.Tensor:
        """Windows without the oldest samples that fill no patch.

        Raises EstimatorError if they are shorter than a patch or longer than the context.
        """
        length = windows.shape[1]
        tokens = length // self.patch
        if not 1 <= tokens <= self.tokens:
            raise EstimatorError(f"a window has {length} samples; expected {self.patch} to {self.tokens * self.patch}")
        return windows[:, -tokens * self.patch :]

    def read(self, columns: torch.Tensor, facts: torch.Tensor) -> torch.Tensor:
        """The mean over the views of what the encoder makes of columns of whole patches, (batch, 2 width).

        Where the patches happen to begin changes most answers by about half of their error; a view is one alignment.
        In training two of them are drawn, so that all are learned for the price of two.
        """
        shifts = self.shifts
        if self.training and len(shifts) > 2:
            shifts = [shifts[k] for k in torch.randperm(len(shifts))[:2].tolist()]
        parts = [self._encode(columns, facts)] if 0 in shifts else []
        moved = [self._shifted(columns, shift)[:, -self.tokens * self.patch :] for shift in shifts if shift]
        if moved:
            parts += self._encode(torch.cat(moved), facts.repeat(len(moved), 1)).split(len(columns))
        return torch.stack(parts).mean(dim=0)

    def _shifted(self, columns: torch.Tensor, shift: int) -> torch.Tensor:
        """One patch more, which takes what sticks out at both ends when the others begin ``shift`` samples earlier."""
        nothing = torch.zeros_like(columns[:, : self.patch])
        nothing[:, :, -self.outputs :] = 1  # missing
        return torch.cat([nothing[:, :shift], columns, nothing[:, shift:]], dim=1)

    def _encode(self, columns: torch.Tensor, facts: torch.Tensor) -> torch.Tensor:
        """Mean and maximum over the encoded patches (batch, 2 width)."""
        patches = columns.reshape(len(columns), -1, self.patch * self.column_count)
        embedded = self.embedding(patches) + self.position[-patches.shape[1] :]
        encoded = self._transformed(embedded + facts[:, None] if self.facts_count else embedded)
        return self.norm(torch.cat([encoded.mean(dim=1), encoded.amax(dim=1)], dim=1))

    def _transformed(self, embedded: torch.Tensor) -> torch.Tensor:
        if not (self.training and self.coarse):
            exact: torch.Tensor = self.encoder(embedded)
            return exact
        # what is embedded has digits that count: only the encoder is coarse
        if embedded.is_cuda:
            with torch.autocast("cuda", torch.bfloat16):
                return torch.as_tensor(self.encoder(embedded)).float()
        # fused attention is slow in bfloat16 on a processor
        with torch.autocast("cpu", torch.bfloat16), sdpa_kernel(SDPBackend.MATH):
            rounded: torch.Tensor = self.encoder(embedded)
        return rounded.float()

    def columns(self, windows: torch.Tensor) -> torch.Tensor:
        """Windows (batch, length, columns), missing readings not a number, to (batch, length, multi-scale columns)."""
        series = windows[:, :, : self.outputs]
        missing = torch.isnan(series)
        low = torch.nanquantile(series, LOW, dim=1, keepdim=True)
        above = series - low
        steps = torch.cat([torch.zeros_like(series[:, :1]), series.diff(dim=1)], dim=1)
        parts = [windows, 5 * steps]
        parts += [GAIN * torch.asinh(above / scale) for scale in LEVEL_SCALES]
        parts += [GAIN * torch.asinh(steps / scale) for scale in STEP_SCALES]
        return torch.cat([torch.nan_to_num(torch.cat(parts, dim=2)), missing.to(windows.dtype)], dim=2)


def silent(inputs: int, outputs: int) -> nn.Linear:
    """A layer that answers nothing before it is trained: an earlier estimator's weights keep their sense beside it."""
    layer = nn.Linear(inputs, outputs)
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer
