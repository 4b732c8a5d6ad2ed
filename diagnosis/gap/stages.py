"""One stage of the search: a fit, its noise, its twins, and what they say of all candidates that remain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.gap.colours import Colours, discrepancy, estimated_colours
from diagnosis.gap.episode import Episode, largest_episode
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import Linearised
from diagnosis.gap.scan import Scan, scan
from diagnosis.gap.twins import TWINS, Twins, draw_twins

LEVEL = 0.02
"""Family-wise level at which a candidate is a gap, and at half of it each misfit of whatever kind: 0.05 in all."""
STRONG = 3.0
"""Log Bayes factor that Kass and Raftery (1995, Journal of the American Statistical Association 90:773) call strong."""
CLEAR = 5.0
"""Log Bayes factor that is very strong to them, and more."""


@dataclass(frozen=True)
class Tested:
    """Family-wise p of the best candidate, p of the residual's square, gain of a slow discrepancy, and an episode."""

    p_value: float
    misfit_p: float
    slow: float
    episode: Episode | None


@dataclass(frozen=True)
class Stage:
    """``scan`` is of the readings that are fitted, and so is which candidate is tried; ``tested`` is of all readings.

    ``discrepant`` are the colours with a discrepancy, ``left_fitted`` its gain in log evidence, both of what is fitted.
    """

    lin: Linearised
    grams: Grams
    colours: Colours
    twins: Twins
    scan: Scan
    left_fitted: float
    discrepant: dict[int, Colour]
    tested: Tested

    @property
    def candidate_found(self) -> bool:
        """Whether some candidate is significant, all of them considered."""
        return self.tested.p_value <= LEVEL

    @property
    def misfits(self) -> bool:
        """Whether the residual is larger than its own twins' residuals are."""
        return self.tested.misfit_p <= LEVEL / 2

    @property
    def episodic(self) -> bool:
        """Whether one channel reads off for a while, as hardly any twin does, and more than by chance.

        Not with replayed actuators: what stays unknown of their meters makes such stretches, too.
        """
        one, replay = self.tested.episode, self.lin.problem.replay
        return one is not None and not replay and one.p_value <= LEVEL / 2 and one.gain > CLEAR

    @property
    def discrepancy(self) -> bool:
        """Whether a discrepancy without a cause is strong evidence: a slow one, or an episode."""
        return self.tested.slow > STRONG or self.episodic

    @property
    def left_over(self) -> float:
        """Gain in log evidence of a discrepancy without a cause, slow or for a while, of all readings."""
        one = self.tested.episode
        return max(self.tested.slow, one.gain if one is not None else 0.0)


def examine(
    lin: Linearised,
    observed: np.ndarray,
    size: np.ndarray,
    every: np.ndarray | None = None,
    *,
    twins: int = TWINS,
    seed: int = 0,
) -> Stage:
    """Examine a linearised fit.

    Parameters
    ----------
    observed
        Readings that are fitted, shape (outputs, steps).
    size
        Standard deviation of one reading's error, shape (outputs,) [unit of each].
    every
        All readings, those that are kept for scoring too: whether there is a gap is told by them all. Those that are
        fitted if not given.
    """
    grams = Grams(lin, observed)
    colours = estimated_colours(grams, size)
    drawn = draw_twins(grams, colours, twins, seed)
    left_over, discrepant = discrepancy(grams, colours, size)
    found = scan(drawn, lin.effects, drawn.left.square)
    if every is not None and not np.array_equal(every, observed):
        tested = examine(lin, every, size, twins=twins, seed=seed).tested
    else:
        tested = Tested(found.p_value, found.misfit_p, left_over, largest_episode(grams, colours, drawn))
    # each twin's readings have been asked all that is asked of them
    return Stage(lin, grams, colours, replace(drawn, rows={}), found, left_over, discrepant, tested)
