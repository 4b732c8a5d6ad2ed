"""What could have been seen, before anything is ranked: of every candidate the size, and what it would look like."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from diagnosis.effects import Effect
from diagnosis.gap.conditions import Otherwise, expected
from diagnosis.gap.scan import NEGLIGIBLE, SEEN
from diagnosis.gap.schema import ConditionOf, Detectability
from diagnosis.gap.stages import Stage

OFTEN = 0.9
"""Share of the cases in which an effect of the size from which it is said to be seen is seen."""
TYPICAL = 2.0
"""Size, in scales, at which it is said what a candidate would be mistaken for."""


def detectability(first: Stage) -> list[Detectability]:
    """The table of all candidates of the first stage."""
    found, scan = [], first.scan
    for j, effect in enumerate(scan.effects):
        found.append(
            Detectability(
                name=effect.name,
                share=float(scan.share[j]),
                expected=float(scan.expected[j]),
                smallest=smallest(effect, float(scan.expected[j]), float(scan.threshold[j])),
                confusable=[scan.effects[i].name for i in scan.alike(j, TYPICAL)],
                ratio=float(scan.ratio[j]),
                p_value=float(scan.adjusted[j]),
            )
        )
    return found


def smallest(effect: Effect, reached: float, threshold: float) -> float | None:
    """The amplitude [unit] from which an effect is seen in OFTEN of the cases; None if none allowed is.

    What the best amplitude that does not matter explains is no evidence (:mod:`diagnosis.gap.scan`): an effect is seen
    whose estimate is beyond that one by what makes up the threshold. Estimates scatter by 1 / sqrt(F) [scales] about
    the truth, so that at that size itself half of the effects would be seen.

    Parameters
    ----------
    reached
        Log-likelihood ratio F / 2 at one scale.
    """
    if 2 * reached <= SEEN:  # such a candidate takes no part, whatever its size
        return None
    scatter = float(norm.ppf(OFTEN) / np.sqrt(2 * reached))
    needed = (NEGLIGIBLE + float(np.sqrt(threshold / reached)) + scatter) * effect.scale
    return needed if needed <= max(effect.upper, -effect.lower) else None


def otherwise_seen(one: Otherwise, first: Stage, size: np.ndarray) -> ConditionOf:
    """What would be seen under another condition, held against the same marks.

    ``size``: standard deviation of one reading's error, shape (outputs,) [unit of each].
    """
    reached = expected(one, first.colours.best, size)
    seen = zip(first.lin.effects, first.scan.threshold.tolist(), strict=True)
    return ConditionOf(
        condition=one.condition,
        smallest={one.name: smallest(one, reached[one.name], least) for one, least in seen if one.name in reached},
    )
