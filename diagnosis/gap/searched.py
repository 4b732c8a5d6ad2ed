"""A search for the cause and what it came to: :mod:`diagnosis.gap.search` makes it, the answer is told from it."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.effects import Effect
from diagnosis.fitting.failures import Unfinished
from diagnosis.fitting.problem import Problem
from diagnosis.gap.made import Made
from diagnosis.gap.refit import Refit
from diagnosis.gap.stages import CLEAR, Stage
from diagnosis.gap.weighing import Judged


@dataclass
class Search:
    """All stages, the base model's fit, the refits made at each stage (best first), and why candidates were not tried.

    ``settled``: the best refit of each stage as the next stage has it, simulated anew where it came to.
    ``tried``: at each stage what all candidates that were refitted were worth before some were fitted afresh, or all
    candidates where the base model's fit began.
    ``confirmed``: whether what the straight line found at first is there in a refit, or in the residual itself.
    ``plain``: the base model's problem before its nuisances were widened, ``begin`` (unknowns,) where its fit began:
    the middle of the prior if None.
    ``beside``: the stage and refits by which the candidates of a stage are weighed, by its place, where the effect that
    was found with them was chosen later (:mod:`diagnosis.gap.exchange`); its own if it is not there.
    ``bare``: the base model fitted on the straight lines of refits that have lines of their own.
    ``failed``: candidates whose simulation or algebra failed, at whatever step, and why. ``unfinished``: steps of the
    search that are lacking, and why; ``searched``: whether all candidates that stood out were refitted.
    ``dropped``: effects that were chosen and given up, because nothing shows that there is a gap.
    ``simulations`` in all of the search; ``made``: what need not be made again.
    """

    stages: list[Stage]
    base: Refit
    plain: Problem
    begin: np.ndarray | None = None
    refits: list[list[Refit]] = field(default_factory=list)
    settled: list[Refit] = field(default_factory=list)
    tried: list[Sequence[Judged]] = field(default_factory=list)
    excluded: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    unfinished: Unfinished = field(default_factory=Unfinished)
    searched: bool = True
    beside: dict[int, tuple[Stage, list[Refit]]] = field(default_factory=dict)
    bare: list[Refit] = field(default_factory=list)
    confirmed: bool = True
    dropped: tuple[str, ...] = ()
    simulations: int = 0
    made: Made = field(default_factory=Made)

    @property
    def path(self) -> Hashable:
        """What a refit depends on beside its own effect: of every stage, what was chosen, where it is, and the colours.

        The same effects come to another optimum where they were fitted afresh.
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

    @property
    def share_left(self) -> float:
        """Share of what was left without a cause at first that the chosen effects do not explain."""
        first = max(self.stages[0].left_over, 1e-9)
        return float(np.clip(self.last.left_over / first, 0.0, 1.0)) if self.stages[0].left_over > 1.0 else 0.0


def outdone(found: Search) -> tuple[Refit, float] | None:
    """The most plausible of ``bare``, and what it has in log evidence over the first stage; None if it gains little.

    As far as the straight lines tell on which it was fitted.
    """
    best = max(found.bare, key=lambda one: one.evidence, default=None)
    if best is None:
        return None
    first = found.stages[0]
    gain = best.evidence - first.grams.evidence(first.colours.best)
    return (best, gain) if gain >= CLEAR else None
