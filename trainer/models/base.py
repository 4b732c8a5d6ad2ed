"""What every estimator has in common: its shape, its recipe, its interface, its initialisation and its head."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import nn

from trainer.reading.facts import known_parameters
from trainer.reading.windows import Batch

SLOPE = 0.2
"""Slope of LeakyReLU below zero (paper, Table 2)."""


@dataclass(frozen=True)
class Shape:
    """Sizes of an estimator's windows and answers."""

    length: int
    """samples of a window"""
    outputs: int
    """columns of an encoded window that are outputs of the system; they come first"""
    recorded: int
    """columns that were recorded: the outputs, then the inputs"""
    columns: int
    """all columns: the recorded, then those that come from the clock"""
    parameters: int
    step: float
    """[s]"""
    static: int = 0
    """columns at the end that are constant over a window: facts, and which of them are known"""
    known: int = 0
    """facts that are parameters: all of them, or none"""


@dataclass(frozen=True)
class Recipe:
    """How an estimator is trained unless the user says otherwise. The defaults are the paper's (section 4)."""

    steps: int = 2000
    batch_size: int = 16
    lr: float = 1e-3
    schedule: Literal["constant", "cosine"] = "constant"
    optimiser: Literal["adamax", "adamw", "muon"] = "adamax"


class Estimator(nn.Module):
    """Windows in, standardised log10 parameters out. Its first argument is the shape; the others are options."""

    recipe: ClassVar[Recipe] = Recipe()
    iterates: ClassVar[bool] = True
    """False where :meth:`prepare` is the whole training."""
    reads_missing: ClassVar[bool] = False
    """Whether outputs may be missing, not a number, in its windows."""
    reads_shorter: ClassVar[bool] = False
    """Whether windows may be shorter than its shape says."""
    rounds: ClassVar[bool] = False
    """Whether it can be trained coarsely."""
    means: ClassVar[bool] = False
    """Whether its answers are made means; the paper takes them back to units as they are (section 4.1)."""
    static: int = 0
    """Static columns of its windows; set when it is built, as :attr:`known` is."""
    known: int = 0
    """How many parameters its windows may tell: all of them, or none."""
    coarse: bool = False
    """Whether larger products are rounded to bfloat16 while training, for speed."""

    def prepare(self, draw: Callable[[int], Batch], validation: Batch, windows: int) -> None:
        """See training data once, before the first step: ``draw(n)`` gives n random training windows.

        ``windows`` is how many windows the whole training may see.
        """

    def forward(self, windows: torch.Tensor, time: torch.Tensor) -> torch.Tensor:
        """Estimate.

        Parameters
        ----------
        windows
            float32 (batch, length, columns).
        time
            First time stamps, float64 (batch,) [s since time zero].

        Returns
        -------
        torch.Tensor
            float32 (batch, parameters).
        """
        raise NotImplementedError

    def with_known(self, answers: torch.Tensor, windows: torch.Tensor) -> torch.Tensor:
        """Answers (batch, parameters) in which a parameter that the windows tell has its known value."""
        if not self.known:
            return answers
        known, values = known_parameters(windows, self.static, self.known)
        return torch.where(known, values, answers)

    def answer_and_embed(self, windows: torch.Tensor, time: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Answers, and what else the estimator makes of windows, (batch, any): a posterior is conditioned on both.

        Nothing else by default. Arguments are those of :meth:`forward`.
        """
        answers = self(windows, time)
        return answers, answers[:, :0]


def initialise(module: nn.Module) -> None:
    """Xavier normal weights, zero biases: linear, convolutional, attention and recurrent layers (paper, section 3)."""
    for part in module.modules():
        if isinstance(part, nn.Linear | nn.Conv1d):
            nn.init.xavier_normal_(part.weight)
            if part.bias is not None:
                nn.init.zeros_(part.bias)
        elif isinstance(part, nn.MultiheadAttention):
            # torch stacks the three projections in one matrix; each is a linear layer of its own
            for projection in part.in_proj_weight.chunk(3):
                nn.init.xavier_normal_(projection)
            nn.init.zeros_(part.in_proj_bias)
        elif isinstance(part, nn.LSTM):
            for name, weight in part.named_parameters():
                if name.startswith("weight"):
                    for gate in weight.chunk(4):
                        nn.init.xavier_normal_(gate)
                else:
                    nn.init.zeros_(weight)


def regression_head(width: int, parameters: int) -> nn.Sequential:
    """LayerNorm, then an MLP with LeakyReLU (section 3). The paper gives no widths: twice the embedding, then once."""
    return nn.Sequential(
        nn.LayerNorm(width),
        nn.Linear(width, 2 * width),
        nn.LeakyReLU(SLOPE),
        nn.Linear(2 * width, width),
        nn.LeakyReLU(SLOPE),
        nn.Linear(width, parameters),
    )
