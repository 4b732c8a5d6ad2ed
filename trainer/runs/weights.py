"""Weights of a network, read beside the card that describes them: no more than the two agree on is ever made room for.

A card says how large a network is. One that was changed could ask for all memory, or for layers without end, so the
network is built under a budget that its own weights set.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors
from torch import nn
from torch.utils._python_dispatch import TorchDispatchMode

from shared.errors import EstimatorError
from shared.reading import MIB, newer, why
from trainer.runs.pair import read_pair

OPERATIONS = 2_000
"""On tensors, while a network is built, beside a hundred for each tensor of its weights; ours take ten, and 600."""
ROOM = 256 * MIB
"""Bytes that a network may make beside eight times its weights: positions, masks, initial values."""

_UNFIT = (
    *(SafetensorError, ArithmeticError, AttributeError, LookupError, MemoryError, TypeError),
    *(AssertionError, RuntimeError, ValueError, EstimatorError),
)
"""What torch and the networks raise where sizes or options make no sense."""

Network = TypeVar("Network", bound=nn.Module)


class _Budget(TorchDispatchMode):
    """Ends what makes more tensors than it may, before they are filled."""

    def __init__(self, room: int, operations: int = OPERATIONS) -> None:
        super().__init__()
        self.room, self.operations = room, operations

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        made = func(*args, **(kwargs or {}))
        self.operations -= 1
        self.room -= made.nbytes if isinstance(made, torch.Tensor) else 0
        if self.room < 0 or self.operations < 0:
            raise ValueError("it is too large a network for its weights")
        return made


def weights_data(network: nn.Module) -> bytes:
    """The weights of a network as a file holds them: of equal weights the bytes are equal."""
    return save_tensors({name: one.detach().contiguous().clone() for name, one in network.state_dict().items()})


def load_weights(path: Path, sha256: str, card: str, again: str, build: Callable[[], Network]) -> Network:
    """The network that ``build`` makes, with the weights of a file.

    ``card`` says ``sha256`` of the file; ``again`` is what is to be done where they cannot be used. Raises
    EstimatorError if the file cannot be read, is not the card's, or does not fit the network; or a weight is not
    finite.
    """
    data = read_pair(path, sha256, card, again)
    try:
        tensors = load_tensors(data)
        budget = _Budget(8 * len(data) + ROOM, OPERATIONS + 100 * len(tensors))
        with torch.random.fork_rng(devices=[]), budget:
            network = build()  # its initial weights, soon replaced, must not use up the host's random numbers
        network.load_state_dict(tensors)
    except _UNFIT as error:
        raise EstimatorError(f"{path}: does not fit {card} ({why(error)}); {again}") from None
    for name, one in network.state_dict().items():
        if one.is_floating_point() and not bool(torch.isfinite(one).all()):
            raise EstimatorError(f"{path}: {name} has values that are not finite; {again}")
    return network.eval()


def check_card_version(path: Path, raw: Any, ours: int, made_by: str) -> None:
    """Refuse a card of a newer version, or without one: an EstimatorError."""
    version = raw.get("schema_version") if isinstance(raw, dict) else None
    if version is None:
        raise EstimatorError(f"{path}: schema_version is missing; expected a file made by `{made_by}`")
    if said := newer(version, ours):
        raise EstimatorError(f"{path}: {said}")
