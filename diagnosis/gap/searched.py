"""A search for the cause and what it came to: :mod:`diagnosis.gap.search` makes it, the answer is told from it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.failures import Unfinished
from diagnosis.fitting.problem import Problem
from diagnosis.gap.linear import Linearised
from diagnosis.gap.refit import Refit
from diagnosis.gap.rivals import Rivals
from diagnosis.gap.stages import Stage

Names = tuple[str, ...]


class Judged(Protocol):
    """A candidate (the last of the names) and its log evidence, as a refit has them."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects."""

    @property
    def evidence(self) -> float:
        """Up to a constant that all have alike."""


@dataclass(frozen=True)
class Ranked:
    """What a candidate (the last of the names) is worth where the base model's fit began: its log evidence there."""

    names: Names
    evidence: float


@dataclass
class Made:
    """What a search has made, by what led to it: nothing is made twice, and a search among fewer candidates shares it.

    The first part of every key is the path of stages (:attr:`Search.path`) that led there. ``rivals``: all candidates
    where the base model's fit began, and the names of those that were asked. ``alike``: the foremost where the best of
    them is, by their names.
    ``refits``: of a second effect, by its name. ``renewed``: a refit linearised by the candidates that remain, by its
    effects' names and its unknowns' bytes. ``apart``: both lines of a fit to a part, by the bytes of what was fitted;
    its path is that of these stages alone. None is what cannot be simulated. ``base``: the base model's fit, and
    linearised by all candidates; ``led``: whether another optimum was looked for, from where that fit began.
    ``line``: where it began.
    """

    base: tuple[Refit, Linearised] | None = None
    led: bool = False
    line: Linearised | None = None
    rivals: dict[Hashable, tuple[set[str], Rivals]] = field(default_factory=dict)
    alike: dict[tuple[Hashable, Names], Rivals] = field(default_factory=dict)
    refits: dict[tuple[Hashable, str], Refit] = field(default_factory=dict)
    renewed: dict[tuple[Hashable, Names, bytes], Linearised] = field(default_factory=dict)
    apart: dict[tuple[Hashable, bytes], tuple[Linearised, Linearised]] = field(default_factory=dict)


@dataclass
class Search:
    """All stages, the base model's fit, the refits made at each stage (best first), and why candidates were not tried.

    ``settled``: the best refit of each stage as the next stage has it.
    ``tried``: at the first stage what all candidates were worth where the base model's fit began; none at a later one.
    ``compared``: the foremost where the best of them is, and the base model there, whether or not a gap is there.
    ``confirmed``: whether what the straight line found at first is there in a refit, or in the residual itself.
    ``plain``: the base model's problem before its nuisances were widened, ``begin`` (unknowns,) where its fit began:
    the middle of the prior if None.
    ``failed``: candidates whose simulation or algebra failed, at whatever step, and why. ``unfinished``: steps of the
    search that are lacking, and why; ``searched``: whether all candidates that stood out were refitted.
    ``dropped``: effects that were chosen and given up, because nothing shows that there is a gap.
    ``made``: what need not be made again.
    """

    stages: list[Stage]
    base: Refit
    plain: Problem
    begin: np.ndarray | None = None
    refits: list[list[Refit]] = field(default_factory=list)
    settled: list[Refit] = field(default_factory=list)
    tried: list[Sequence[Judged]] = field(default_factory=list)
    compared: Rivals | None = None
    excluded: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    unfinished: Unfinished = field(default_factory=Unfinished)
    searched: bool = True
    confirmed: bool = True
    dropped: tuple[str, ...] = ()
    made: Made = field(default_factory=Made)

    @property
    def path(self) -> Hashable:
        """What a refit depends on beside its own effect: of every stage, what was chosen, where it is, and the colours.

        The same effects come to another optimum where the colours are others.
        """
        return tuple(
            (tuple(e.name for e in one.lin.chosen), one.lin.z.tobytes(), tuple(sorted(one.colours.best.items())))
            for one in self.stages
        )

    @property
    def last(self) -> Stage:
        """The stage of the effects that were chosen."""
        return self.stages[-1]

    @property
    def chosen(self) -> tuple[Effect, ...]:
        """Effects that were chosen, in the order in which they were found."""
        return self.last.lin.chosen


def evidence_before(found: Search) -> float:
    """Log evidence of what was chosen so far, its amplitudes within their bounds as those of refits are."""
    stage = found.last
    if not found.settled:
        return stage.grams.evidence(stage.colours.best)
    return found.settled[-1].evidence_with(stage.colours.best)
