"""Optimisers by the name in an estimator's recipe."""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import nn

from trainer.models.base import Recipe

WEIGHT_DECAY = 0.01
MUON_RATIO = 20.0
"""Muon's learning rate over AdamW's: its steps are orthogonal matrices, of size one whatever the gradient."""


def make_optimisers(network: nn.Module, recipe: Recipe) -> list[torch.optim.Optimizer]:
    """What steps the weights: Adamax (the paper's), AdamW, or Muon for the inner matrices with AdamW for the rest."""
    if recipe.optimiser == "adamax":
        return [torch.optim.Adamax(network.parameters(), lr=recipe.lr)]
    if recipe.optimiser == "adamw":
        return [torch.optim.AdamW(network.parameters(), lr=recipe.lr, weight_decay=WEIGHT_DECAY)]
    matrices = [p for name, p in network.named_parameters() if p.ndim == 2 and name.endswith("weight")]
    # layers that give answers are not inner ones; the last matrix is one, and has a row for each
    inner = [p for p in matrices if len(p) != len(matrices[-1])]
    chosen = {id(p) for p in inner}
    rest = [p for p in network.parameters() if id(p) not in chosen]
    return [
        torch.optim.Muon(inner, lr=MUON_RATIO * recipe.lr, weight_decay=0.0),
        torch.optim.AdamW(rest, lr=recipe.lr, weight_decay=WEIGHT_DECAY),
    ]


def scale_rates(optimisers: Iterable[torch.optim.Optimizer], factor: float) -> None:
    """Set every learning rate to its first value times ``factor``."""
    for one in optimisers:
        for group in one.param_groups:
            group["lr"] = group.setdefault("initial_lr", group["lr"]) * factor
