"""How many effects answers name, and what as many names drawn at random would be worth: a long answer is cheap."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np
from pydantic import BaseModel, ConfigDict

from diagnosis.blind.intervals import Figure, Share, figure, median, share
from diagnosis.blind.opened import Row

NAMED: tuple[tuple[int, int | None], ...] = ((1, None), (1, 1), (2, 4), (5, None))
"""Least and largest number of names (None: without end) of answers that are counted together."""
MOST = 0.9


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Named(_Strict):
    """Of answers that name ``least`` to ``most`` effects: how often a true cause is among them.

    ``chance``: how often one would be, on average, if as many names were drawn at random from the candidates that could
    be named in that recording; nothing where it has no cause of the library.
    """

    least: int
    most: int | None
    held: Share
    chance: Figure


class Names(_Strict):
    """Of answers that name effects: how many they name, and how often rightly; the first of ``by_size`` is of all.

    ``nine_in_ten`` of the answers name at most so many.
    """

    median: Figure
    nine_in_ten: Figure
    largest: int | None
    by_size: list[Named]


def names(rows: Sequence[Row], seed: int = 0) -> Names:
    """Count the names of answers that name effects; the others do not count."""
    named = [row for row in rows if row.named]
    lengths = np.array([len(row.named) for row in named])
    return Names(
        median=figure(lengths, median, seed=seed),
        nine_in_ten=figure(lengths, _nine_in_ten, seed=seed),
        largest=max((len(row.named) for row in named), default=None),
        by_size=[_of_length(named, least, most, seed) for least, most in NAMED],
    )


def _nine_in_ten(drawn: np.ndarray) -> np.ndarray:
    return np.asarray(np.quantile(drawn, MOST, axis=1, method="higher"))


def _of_length(named: Sequence[Row], least: int, most: int | None, seed: int) -> Named:
    ones = [row for row in named if least <= len(row.named) <= (most or len(row.named))]
    return Named(
        least=least,
        most=most,
        held=share([bool(set(row.effects) & set(row.named)) for row in ones]),
        chance=figure(np.array([by_chance(row) for row in ones]), seed=seed),
    )


def by_chance(row: Row) -> float:
    """Probability that as many names as the answer has hold a true cause if they are drawn from all candidates."""
    verdict = row.outcome.verdict
    candidates = set(row.named) | (set(verdict.probabilities) if verdict is not None else set())
    wrong, count = len(candidates - set(row.effects)), len(row.named)
    return 1.0 - comb(wrong, count) / comb(len(candidates), count)
