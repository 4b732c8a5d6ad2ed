"""Errors of an estimator's answers to validation systems, condition by condition: measured once, looked up ever after.

What an error is depends on how long the window is, which channels it lacks and how noisy its readings are. One figure
over all that an estimator was trained on is too small for short and poor recordings, and too large for the others.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
import torch

from shared.progress import tracked
from shared.system import System
from trainer.models.base import Estimator
from trainer.reading.noise import Sensors
from trainer.reading.windows import WindowSource, disjoint_windows
from trainer.runs.checkpoint import Card, forward_in_chunks
from trainer.runs.scatter import Errors, means_from

WINDOWS = 256
"""Of each condition, at most: errors within 5 %, and minutes where there are many conditions and a large network."""


class Typical(NamedTuple):
    """Root mean square error of each parameter [own unit], None where it is not known; and a sentence on it."""

    rmse: dict[str, float] | None
    note: str


def measured_errors(
    network: Estimator,
    card: Card,
    source: WindowSource,
    system: System,
    rows: np.ndarray,
    seed: int,
    progress: bool = False,
) -> list[Errors]:
    """Errors under every condition: all lengths, all sensor presets, the usual sets of missing channels.

    ``rows`` of ``source`` are the validation systems; it is left as it was. All conditions of one length have the same
    windows.
    """
    encoding = card.encoding
    numbers = [int(one) for one in np.random.SeedSequence(seed).generate_state(2)]
    presets = list(dict.fromkeys(card.noise.split()))
    conditions = list(product(encoding.lengths, absences(encoding.optional)))
    found = []
    for length, absent in tracked(conditions, "validation errors", shown=progress and len(conditions) > 1):
        rng = np.random.default_rng(numbers[0])
        where, starts = disjoint_windows(rows, len(source.time), length, WINDOWS, rng)
        answers, truth = [], np.empty(0)
        for preset in presets:
            readings = source.under(
                Sensors(system, encoding.recorded, preset),
                torch.Generator(source.values.device).manual_seed(numbers[1]),
                Without(encoding.recorded, absent),
            )
            batch = readings.gather(torch.from_numpy(where), torch.from_numpy(starts), length)
            answers.append(forward_in_chunks(network, batch.windows, batch.time))
            truth = encoding.estimates(batch.targets)  # the same under every preset
        scatter = np.array([_rms(encoding.log_ratio(encoding.estimates(one), truth)) for one in answers])
        factors = means_from(scatter) if network.means else None
        rmse = [_rms(encoding.estimates(one, factors) - truth) for one in answers]
        found += [
            Errors(
                length=length,
                absent=absent,
                noise=preset,
                windows=len(where),
                systems=len(np.unique(where)),
                rmse=dict(zip(encoding.parameters, error.tolist(), strict=True)),
                scatter=dict(zip(encoding.parameters, row.tolist(), strict=True)) if network.means else None,
            )
            for preset, error, row in zip(presets, rmse, scatter, strict=True)
        ]
    return found


def _rms(values: np.ndarray) -> np.ndarray:
    """Root mean square over windows (windows, parameters)."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


class Without:
    """Makes channels missing throughout."""

    def __init__(self, recorded: list[str], absent: list[str]) -> None:
        self.lost = torch.tensor([name in absent for name in recorded])

    def __call__(self, values: torch.Tensor, _: torch.Generator) -> torch.Tensor:
        """Windows (batch, length, recorded) without those channels."""
        return values.masked_fill(self.lost.to(values.device), torch.nan)


def absences(optional: list[str]) -> list[list[str]]:
    """Sets of missing channels: none, each one alone, all; the number of all sets would double with every channel."""
    sets = [[], *([name] for name in optional), list(optional)]
    return [one for k, one in enumerate(sets) if one not in sets[:k]]


def typical_errors(card: Card, length: int, absent: list[str], noise: str | None = None) -> Typical:
    """The errors of estimates from windows of ``length`` samples that lack ``absent`` channels, where a card has them.

    Several presets of ``noise``, joined by spaces, are mixed evenly. None is a recording's, of which nobody knows: then
    each parameter has the largest error that it has under a preset of the training.
    """
    presets = list(dict.fromkeys((noise or card.noise).split()))
    found = {one.noise: one for one in card.validation_errors if one.length == length and set(one.absent) == {*absent}}
    what = _condition(card, length, absent, (" or " if noise is None else " and ").join(presets))
    if set(presets) <= set(found):
        names = card.encoding.parameters
        each = np.array([[found[preset].rmse[name] for name in names] for preset in (noise or card.noise).split()])
        rmse = each.max(axis=0) if noise is None else np.sqrt(np.mean(each**2, axis=0))
        one = found[presets[0]]
        note = f"root mean square error on {one.windows} windows of {one.systems} validation systems, {what}"
        if len(presets) > 1:  # two figures, and both are told of the same estimator: by `predict` and by `calibration`
            note += ", whichever is larger" if noise is None else ", mixed"
        return Typical(dict(zip(names, rmse.tolist(), strict=True)), note)
    if (
        not card.validation_errors
        and _has_one_condition(card)
        and length == card.length
        and noise in (None, card.noise)
    ):
        return Typical(card.validation_rmse, f"root mean square error on the run's validation windows, {what}")
    if card.validation_errors:
        return Typical(None, f"the run's card has errors of validation systems, but none for {what}")
    return Typical(None, f"the run's card has one figure only ({whole_condition(card)}), and none for {what}")


def whole_condition(card: Card) -> str:
    """In words, what ``validation_rmse`` of a card is over."""
    optional = card.encoding.optional
    text = _condition(card, card.length, [], " and ".join(dict.fromkeys(card.noise.split())))
    return text + (f", with and without {', '.join(optional)}" if optional else "")


def _condition(card: Card, length: int, absent: list[str], noise: str) -> str:
    text = f"{length * card.encoding.step / 3600:g} h"
    text += f" without {', '.join(absent)}" if absent else ""
    return f"{text}, noise {noise}"


def _has_one_condition(card: Card) -> bool:
    """Whether all validation windows of a card were under the same condition, but for gaps."""
    return not card.encoding.optional and len(set(card.noise.split())) == 1 and bool(card.validation_rmse)
