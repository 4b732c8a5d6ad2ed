"""One stage of the search: a fit, its noise, its twins, and what they say of all candidates that remain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.gap.colours import Colours, discrepancy, estimated_colours
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import Linearised
from diagnosis.gap.scan import Scan, scan
from diagnosis.gap.twins import TWINS, Twins, draw_twins

LEVEL = 0.02
"""Family-wise level at which a candidate is a gap, and at half of it each misfit of whatever kind: 0.04 in all."""


@dataclass(frozen=True)
class Stage:
    """``left_over``: gain in log evidence of a discrepancy without a cause; ``discrepant`` the colours with it."""

    lin: Linearised
    grams: Grams
    colours: Colours
    twins: Twins
    scan: Scan
    left_over: float
    discrepant: dict[int, Colour]

    @property
    def candidate_found(self) -> bool:
        """Whether some candidate is significant, all of them considered."""
        return self.scan.p_value <= LEVEL

    @property
    def misfits(self) -> bool:
        """Whether the residual is larger than its own twins' residuals are."""
        return self.scan.misfit_p <= LEVEL / 2


def examine(lin: Linearised, observed: np.ndarray, size: np.ndarray, *, twins: int = TWINS, seed: int = 0) -> Stage:
    """Examine a linearised fit.

    Parameters
    ----------
    observed
        Readings that count, shape (outputs, steps).
    size
        Standard deviation of one reading's error, shape (outputs,) [unit of each].
    """
    grams = Grams(lin, observed)
    colours = estimated_colours(grams, size)
    drawn = draw_twins(grams, colours, twins, seed)
    left_over, discrepant = discrepancy(grams, colours, size)
    found = scan(drawn, lin.effects, drawn.left.square)
    return Stage(lin, grams, colours, drawn, found, left_over, discrepant)
