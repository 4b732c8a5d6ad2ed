"""Base model and chosen effects fitted anew to a part of the recording: the other part says how far the gap shrinks.

Whether there is a gap, and which effect it is, is told by all readings: a week has none to spare. How far it shrinks
is told by readings that took no part in the fit. Whether they mattered to the choice is looked at, too: the candidates
that were refitted are weighed once more by the fitted readings alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fitting.failures import FAILURES
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import Linearised
from diagnosis.gap.refit import Refit, misfit
from diagnosis.gap.renewal import WORTH, fitted_anew, relinearised
from diagnosis.gap.searched import Search
from diagnosis.gap.stages import Stage

LINES = 5
"""The line is drawn so often at most where all readings say that the nuisance was."""


@dataclass(frozen=True)
class Apart:
    """Fits to a part: ``before`` without effects, ``after`` with those chosen; ``fitted`` (outputs, steps) of both.

    Both are linearised where all readings say that the nuisance was, at unknowns that have their optimum on ``lines``,
    which are drawn where the fitted readings say that it was. ``agreed``: whether the fitted readings alone put the
    same effects first.
    """

    before: Linearised
    after: Linearised
    lines: tuple[Linearised, Linearised]
    fitted: np.ndarray
    agreed: bool


def fitted_apart(found: Search, fitted: np.ndarray) -> Apart:
    """Fit base model and chosen effects to a part.

    Parameters
    ----------
    found
        A search that chose effects.
    fitted
        Readings that are fitted, shape (outputs, steps). They alone move the unknowns. Who was there at any other time
        is told by all readings, and so is the colour of the noise, as the search has it.

    Raises
    ------
    SimulationError
        If the simulation fails where the fit to all readings is.
    """
    made, known = [], found.made.apart
    for until in (found.stages[:1], found.stages):
        stage = until[-1]
        key = (replace(found, stages=until).path, fitted.tobytes())
        if key not in known:
            known[key] = _fitted(stage, stage.lin, fitted)
        made.append(known[key])
    (before, first), (after, last) = made
    return Apart(before, after, (first, last), fitted, _agreed(found, fitted))


def _fitted(stage: Stage, begin: Linearised, fitted: np.ndarray) -> tuple[Linearised, Linearised]:
    """A fit to a part from some place, where all readings say that the nuisance was, and its own line."""
    one = fitted_anew(begin, fitted, stage.colours.best)
    return _lined(one, stage.colours.best, stage.grams.observed), one.lin


def _lined(one: Refit, colours: dict[int, Colour], every: np.ndarray) -> Linearised:
    """A fit linearised where all readings say that the nuisance was.

    Who was there on a day that took no part in the fit is far from where its line was drawn, and one step along it can
    end where the model is nothing like the recording: a gap of kelvins that the effect then "removes". So the line is
    drawn anew until it no longer fits all readings better.
    """
    lin, value = one.lin, np.inf
    for _ in range(LINES):
        try:
            there = relinearised(Grams(lin, every), colours, one.lin.z, every)
        except FAILURES:  # what is likely on the straight line may be nothing that can be run
            break
        before, now = value, misfit(Grams(there, every), colours)
        if now < before:
            lin, value = there, now
        if before - now < WORTH:
            break
    return lin


def _agreed(found: Search, fitted: np.ndarray) -> bool:
    """Whether the fitted readings put first what all readings do, among what was refitted for each of the effects."""
    for stage, refits in zip(found.stages, found.refits, strict=False):
        like = Grams(stage.lin, fitted)
        part = [replace(one, grams=Grams(one.lin, fitted, like)) for one in refits]
        if np.argmax([one.evidence_with(stage.colours.best) for one in part]) != 0:
            return False
    return True
