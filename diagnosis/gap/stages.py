"""One stage of the search: a fit, its noise, its twins, and what they say of all candidates that remain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fitting.grams import Colour, Colours, Grams, discrepancy, estimated_colours
from diagnosis.fitting.lines import Linearised
from diagnosis.gap.scan import LEVEL as LEVEL
from diagnosis.gap.scan import Episode, Scan, largest_episode, scan
from diagnosis.gap.twins import Twins, draw_twins

STRONG = 3.0
"""Log Bayes factor that Kass and Raftery (1995, Journal of the American Statistical Association 90:773) call strong."""
CLEAR = 5.0
"""Log Bayes factor that is very strong to them, and more."""
PLAIN = 8.0
"""Log Bayes factor of a candidate that is a gap whatever twins do. A Bayes factor exceeds K by chance in at most 1 / K
of all recordings without a gap (Markov's inequality), so that of forty candidates one does in at most 1.4 %. Parameters
that bend to the edge of their prior to make up for a cause are evidence of it, but twins begin at that edge and come
back from it as the recording does."""


@dataclass(frozen=True)
class Stage:
    """What is said of one fit and of the candidates that remain.

    ``slow``: gain in log evidence of a slow discrepancy, ``discrepant`` the colours with it; ``episode``: the offset
    over one stretch that stands out most.
    """

    lin: Linearised
    grams: Grams
    colours: Colours
    twins: Twins
    scan: Scan
    slow: float
    discrepant: dict[int, Colour]
    episode: Episode | None

    @property
    def candidate_found(self) -> bool:
        """Whether some candidate is significant, all of them considered, or plain by its evidence."""
        return self.scan.p_value <= LEVEL or float(self.scan.evidence.max(initial=0.0)) >= PLAIN

    @property
    def misfits(self) -> bool:
        """Whether the residual is larger than its own twins' residuals are."""
        return self.scan.misfit_p <= LEVEL / 2

    @property
    def episodic(self) -> bool:
        """Whether one channel reads off for a while, as hardly any twin does, and more than by chance.

        Not with replayed actuators: what stays unknown of their meters makes such stretches, too.
        """
        one, replay = self.episode, self.lin.problem.replay
        return one is not None and not replay and one.p_value <= LEVEL / 2 and one.gain > CLEAR

    @property
    def discrepancy(self) -> bool:
        """Whether a discrepancy without a cause is strong evidence: a slow one, or an episode."""
        return self.slow > STRONG or self.episodic

    @property
    def differs(self) -> bool:
        """Whether anything seems to differ between model and recording."""
        return self.candidate_found or self.misfits or self.discrepancy

    @property
    def left_over(self) -> float:
        """Gain in log evidence of a discrepancy without a cause, slow or for a while."""
        return max(self.slow, self.episode.gain if self.episode is not None else 0.0)


def examine(lin: Linearised, observed: np.ndarray, *, seed: int = 0) -> Stage:
    """Examine a linearised fit.

    Parameters
    ----------
    observed
        Readings that count, shape (outputs, steps).
    """
    grams, size = Grams(lin, observed), lin.problem.floor
    colours = estimated_colours(grams, size)
    drawn = draw_twins(grams, colours, seed=seed)
    slow, discrepant = discrepancy(grams, colours, size)
    found = scan(drawn, lin.effects, drawn.left.square)
    episode = largest_episode(grams, colours, drawn)
    # each twin's readings have been asked all that is asked of them
    return Stage(lin, grams, colours, replace(drawn, rows={}), found, slow, discrepant, episode)
