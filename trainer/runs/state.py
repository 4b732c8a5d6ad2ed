"""The state of an unfinished training: all that it takes to go on as if nothing had happened.

One safetensors file holds the tensors (weights, best weights, optimiser, random number generators) and, as JSON in its
header, the rest: a state is there whole or not at all, and reading it executes nothing.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from shared.errors import EstimatorError
from shared.reading import parse_json, size_of, why
from shared.store import write_atomically

STATE = "state.safetensors"
_FACTS = "facts"

Tensors = dict[str, torch.Tensor]


def write_state(path: Path, parts: dict[str, Tensors], facts: dict[str, Any]) -> None:
    """Write a state whole: named groups of tensors, and facts that JSON can hold."""
    flat = {
        f"{part}/{name}": t.detach().contiguous().clone() for part, group in parts.items() for name, t in group.items()
    }
    write_atomically(path, save(flat, metadata={_FACTS: json.dumps(facts)}))


def read_state(path: Path) -> tuple[dict[str, Tensors], dict[str, Any]]:
    """Read what :func:`write_state` wrote.

    Raises EstimatorError if the file is damaged.
    """
    parts: dict[str, Tensors] = {}
    size_of(path, EstimatorError, "a state of `trainer fit`; remove it to train from the beginning")
    try:
        with safe_open(path, framework="pt") as file:
            facts = parse_json(file.metadata()[_FACTS], f"{path}", EstimatorError, "a state of `trainer fit`")
            if not isinstance(facts, dict):
                raise TypeError("its facts are no table")
            for key in file.keys():  # noqa: SIM118  the file is no mapping
                part, _, name = key.partition("/")
                parts.setdefault(part, {})[name] = file.get_tensor(key)
    except (SafetensorError, OSError, TypeError, KeyError, ValueError) as error:
        raise EstimatorError(f"{path}: damaged ({why(error)}); remove it to train from the beginning") from None
    return parts, facts


def check_settings(path: Path, found: dict[str, Any], expected: dict[str, Any]) -> None:
    """Refuse to go on with a training that was another one: an EstimatorError naming the first setting that differs."""
    for name, value in expected.items():
        if found.get(name) != value:
            raise EstimatorError(
                f"{path}: {name} was {found.get(name)!r} and is {value!r} now; resume with the same, or overwrite"
            )


def generator_states(generators: dict[str, torch.Generator]) -> Tensors:
    """States of torch's own and other random number generators."""
    return {"torch": torch.get_rng_state()} | {name: one.get_state() for name, one in generators.items()}


def restore_generators(generators: dict[str, torch.Generator], states: Tensors) -> None:
    """Put back what :func:`generator_states` gave."""
    torch.set_rng_state(states["torch"])
    for name, one in generators.items():
        one.set_state(states[name])


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> Tensors:
    """An optimiser's memory of each weight, by the weight's number and the quantity."""
    state = optimiser.state_dict()["state"]
    return {f"{number}/{name}": torch.as_tensor(value) for number, one in state.items() for name, value in one.items()}


def restore_optimiser(optimiser: torch.optim.Optimizer, tensors: Tensors) -> None:
    """Put back what :func:`optimiser_tensors` gave."""
    state: dict[int, Tensors] = {}
    for key, value in tensors.items():
        number, _, name = key.partition("/")
        state.setdefault(int(number), {})[name] = value
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
