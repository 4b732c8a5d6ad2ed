"""Candidates of a stage weighed against one another, and the set of them that an answer names.

They are weighed by their evidence with an error that is as wide as what the best of them leaves unexplained: a cause
that acts by a somewhat other law than its candidate must not make one candidate certain against another.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Protocol

import numpy as np

from diagnosis.gap.refit import Refit
from diagnosis.gap.stages import Stage

SURE = 0.8
"""Probability, among candidates, at which one of them is named alone."""
COVER = 0.9
"""What a set that is named together holds of it."""
TEMPER = 3.0
"""What differences of evidence between candidates are divided by (a power posterior, Gruenwald 2012, ALT 23:169).

The true cause acts by a law that is not quite its candidate's, and candidates that are wrong make up for that: taken at
their word, evidences are too sure. Chosen on opened sets (docs/blind-check.md); ``tests/benchmarks/decision.py`` works
out what makes the truth most likely."""


class Judged(Protocol):
    """A candidate (the last of the names) and its log evidence, as a refit has them."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects."""

    @property
    def evidence(self) -> float:
        """Up to a constant that all have alike."""


def worth(
    stage: Stage,
    refits: list[Refit],
    after: Stage,
    *,
    base: Refit | None = None,
    tried: Sequence[Judged] = (),
    later: Collection[str] = (),
    excluded: Collection[str] = (),
) -> dict[str, float]:
    """Log evidence of a stage's candidates over the model without them, with the error that the best leaves.

    What was not fitted as others were is judged as before, moved by what these gained by it (the median), and is no
    better than the last of them.

    Parameters
    ----------
    refits
        Of the stage, the best first.
    after
        The stage with the best of them.
    base
        The model without them, fitted as they were; without, evidences are up to a constant.
    tried
        All that were looked at, as they were worth where the base model's fit began; without, the straight line counts.
    later
        Effects that were found beside it: they are no alternatives to it.
    excluded
        What could not be tried, beside what failed at this stage: only if it was refitted is it an alternative.
    """
    value = {one.names[-1]: one.evidence_with(after.discrepant) for one in refits}
    linear = dict(zip((one.name for one in stage.lin.effects), stage.scan.evidence.tolist(), strict=True))
    known = {one.names[-1]: one.evidence for one in tried} or linear
    gains = [one - known[name] for name, one in value.items() if name in known]
    if gains:
        gain, last = float(np.median(gains)), min(value.values())
        value = {name: min(one + gain, last) for name, one in known.items()} | value
    unknown = {*excluded, *stage.lin.failed} - {one.names[-1] for one in refits}
    without = 0.0 if base is None else base.evidence_with(after.discrepant)
    return {name: one - without for name, one in value.items() if name not in {*later, *unknown}}


def weighed(stage: Stage, refits: list[Refit], after: Stage, **others: Any) -> dict[str, float]:
    """Probabilities of a stage's candidates, given that one of them is the cause; see :func:`worth`."""
    return softmax(worth(stage, refits, after, **others))


def softmax(values: dict[str, float]) -> dict[str, float]:
    """Probabilities from log evidences."""
    if not values:
        return {}
    found = np.array(list(values.values()))
    weight = np.exp((found - found.max()) / TEMPER)
    return dict(zip(values, (weight / weight.sum()).tolist(), strict=True))


def named(chance: dict[str, float], chosen: str) -> tuple[str, ...]:
    """The most probable candidate alone where it is sure enough, else the smallest set that covers.

    The one that was ``chosen``, whose amplitude, parameters and share of the gap are reported, is always in it.
    """
    order = sorted(chance, key=lambda name: -chance[name])
    count = 1
    if chance[order[0]] < SURE:
        count += int(np.searchsorted(np.cumsum([chance[name] for name in order]), COVER))
    first = tuple(order[:count])
    return first if chosen in first else (*first, chosen)
