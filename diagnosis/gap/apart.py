"""Base model and chosen effects fitted anew to a part of the recording: the other part says how far the gap shrinks.

Whether there is a gap, and which effect it is, is told by all readings: a week has none to spare. How far it shrinks
is told by readings that took no part in the fit. Whether they mattered to the choice is looked at, too: the candidates
that were refitted are weighed once more by the fitted readings alone.

The base model's fit may have ended early, and what it leaves then is more than the model has to: all of that would
count as removed. Where the search met a more plausible fit of it (:mod:`diagnosis.gap.bare`), that is begun from as
well, and what fits the fitted readings better is the gap before.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fitting.failures import FAILURES
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import Linearised
from diagnosis.gap.refit import Refit, misfit
from diagnosis.gap.renewal import WORTH, fitted_anew, relinearised
from diagnosis.gap.searched import Search, outdone
from diagnosis.gap.stages import Stage

LINES = 5
"""The line is drawn so often at most where all readings say that the nuisance was."""


@dataclass(frozen=True)
class Apart:
    """Fits to a part: ``before`` without effects, ``after`` with those chosen; ``fitted`` (outputs, steps) of both.

    Both are linearised where all readings say that the nuisance was, at unknowns that have their optimum on ``lines``,
    which are drawn where the fitted readings say that it was. ``agreed``: whether the fitted readings alone put the
    same effects first. ``simulations`` that were made.
    """

    before: Linearised
    after: Linearised
    lines: tuple[Linearised, Linearised]
    fitted: np.ndarray
    agreed: bool
    simulations: int


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
    counts, made, known = [], [], found.made.apart
    for until in (found.stages[:1], found.stages):
        stage, better = until[-1], outdone(found) if len(until) == 1 else None
        other = better[0].lin if better else None
        key = (replace(found, stages=until).path, fitted.tobytes(), b"" if other is None else other.z.tobytes())
        if key not in known:
            lin, line, count = _fitted(stage, stage.lin, fitted)
            if other is not None:
                with suppress(*FAILURES):
                    there, its, more = _fitted(stage, other, fitted)
                    count += more
                    here, away = (misfit(Grams(one, fitted), stage.colours.best) for one in (lin, there))
                    if away < here:
                        lin, line = there, its
            known[key] = lin, line
            counts.append(count)
        made.append(known[key])
    (before, first), (after, last) = made
    return Apart(before, after, (first, last), fitted, _agreed(found, fitted), sum(counts))


def _fitted(stage: Stage, begin: Linearised, fitted: np.ndarray) -> tuple[Linearised, Linearised, int]:
    """A fit to a part from some place, where all readings say that the nuisance was, its own line, and simulations."""
    one = fitted_anew(begin, fitted, stage.colours.best)
    lin, count = _lined(one, stage.colours.best, stage.grams.observed)
    return lin, one.lin, one.simulations + count


def _lined(one: Refit, colours: dict[int, Colour], every: np.ndarray) -> tuple[Linearised, int]:
    """A fit linearised where all readings say that the nuisance was, and the simulations made.

    Who was there on a day that took no part in the fit is far from where its line was drawn, and one step along it can
    end where the model is nothing like the recording: a gap of kelvins that the effect then "removes". So the line is
    drawn anew until it no longer fits all readings better.
    """
    lin, value, count = one.lin, np.inf, 0
    for _ in range(LINES):
        try:
            there = relinearised(Grams(lin, every), colours, one.lin.z, every)
        except FAILURES:  # what is likely on the straight line may be nothing that can be run
            break
        count += there.simulations
        before, now = value, misfit(Grams(there, every), colours)
        if now < before:
            lin, value = there, now
        if before - now < WORTH:
            break
    return lin, count


def _agreed(found: Search, fitted: np.ndarray) -> bool:
    """Whether the fitted readings put first what all readings do, among what was refitted for each of the effects."""
    for k, (own, ones) in enumerate(zip(found.stages, found.refits, strict=False)):
        stage, refits = found.beside.get(k, (own, ones))
        like = Grams(stage.lin, fitted)
        part = [replace(one, grams=Grams(one.lin, fitted, like)) for one in refits]
        best, first = (
            int(np.argmax([one.evidence_with(stage.colours.best) for one in some])) for some in (part, refits)
        )
        if best != (first if k in found.beside else 0):
            return False
    return True
