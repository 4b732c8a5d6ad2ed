"""The paper's patch transformer (section 3, Table 2)."""

from __future__ import annotations

import math

import torch
from torch import nn

from shared.errors import OptionsError
from trainer.models.base import SLOPE, Estimator, Shape, initialise, regression_head


def sinusoidal_encoding(tokens: int, width: int) -> torch.Tensor:
    """Fixed positional encoding of Vaswani et al. (2017), section 3.5; float32 (tokens, width)."""
    place = torch.arange(tokens, dtype=torch.float64)[:, None]
    rate = torch.exp(-math.log(10000.0) * torch.arange(0, width, 2, dtype=torch.float64) / width)
    encoding = torch.zeros(tokens, width, dtype=torch.float64)
    encoding[:, 0::2] = torch.sin(place * rate)
    encoding[:, 1::2] = torch.cos(place * rate)[:, : width // 2]
    return encoding.float()


class PatchTransformer(Estimator):
    """Patches by a strided convolution, a transformer encoder, global average pooling, an MLP head.

    The encoder layers are those of Vaswani et al.: LayerNorm after each residual sum, dropout on each branch.
    Where the patch does not divide the window, the oldest samples are left out.
    """

    def __init__(
        self,
        shape: Shape,
        patch: int = 12,
        width: int = 64,
        layers: int = 4,
        heads: int = 8,
        feedforward: int = 256,
        dropout: float = 0.2,
    ) -> None:
        super().__init__()
        if patch > shape.length:
            raise OptionsError(f"patch is {patch} samples; expected no more than the {shape.length} of the context")
        if width % heads:
            raise OptionsError(f"width is {width}; expected a multiple of the {heads} attention heads")
        self.tokens = shape.length // patch
        self.used = self.tokens * patch
        self.embedding = nn.Conv1d(shape.columns, width, kernel_size=patch, stride=patch)
        self.register_buffer("position", sinusoidal_encoding(self.tokens, width), persistent=False)
        layer = nn.TransformerEncoderLayer(
            width, heads, feedforward, dropout, activation=nn.LeakyReLU(SLOPE), batch_first=True
        )
        self.encoder = nn.TransformerEncoder(layer, layers, enable_nested_tensor=False)
        self.head = regression_head(width, shape.parameters)
        initialise(self)

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """See :class:`Estimator`."""
        embedded = self.embedding(windows[:, -self.used :].transpose(1, 2)).transpose(1, 2)
        tokens: torch.Tensor = self.encoder(embedded + self.position)
        answer: torch.Tensor = self.head(tokens.mean(dim=1))
        return answer
