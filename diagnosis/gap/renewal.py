"""The simulation linearised where it is most plausible: at a fit's unknowns and at the nuisance that is likely there.

A straight line by the nuisance holds near where it was drawn. Persons who come within a step, a controller that
saturates and air that is changed twice an hour bend it, and what the bend leaves behind looks like a gap of the model.
So the line is drawn anew where unknowns and nuisance have moved to, until the evidence (Laplace's, at that point) no
longer grows; a move that lowers it is taken back by half.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.linearisation import Linearisation
from diagnosis.fitting.problem import Problem
from diagnosis.gap.colours import estimated_colours
from diagnosis.gap.grams import Colour, Grams
from diagnosis.gap.linear import Linearised, linearised
from diagnosis.gap.refit import Refit, at_rest, misfit, refit

RENEWALS = 3
WORTH = 1.0
"""A renewal that gains less log evidence than this is the last."""
SHARES = (1.0, 0.4)
"""Of a move to where the straight line sees the optimum."""
NEAR = 0.5
"""Standard deviations of an unknown within which a line drawn elsewhere is as good."""


def settled(
    problem: Problem,
    z: np.ndarray,
    around: Linearisation,
    observed: np.ndarray,
    size: np.ndarray,
    colours: dict[int, Colour] | None = None,
    renewals: int = RENEWALS,
    every: np.ndarray | None = None,
) -> Refit:
    """The optimum of a problem's unknowns with the colour of the noise and all nuisances, linearised where it is.

    Parameters
    ----------
    around
        A linearisation at ``z``, or near.
    observed
        Readings that count, shape (outputs, steps).
    size
        Standard deviation of one reading's error, shape (outputs,) [unit of each].
    colours
        By channel; estimated at the first renewal if not given.
    every
        All readings, which together say what the nuisance was; those that count if not given.
    """
    every = observed if every is None else every
    first = linearised(problem, z, around)
    grams = Grams(first, observed)
    try:
        lin = relinearised(grams, colours or estimated_colours(grams, size).best, z, every)
    except FAILURES:  # what is likely on the straight line may be nothing that the model can be run with
        lin = first
    grams = Grams(lin, observed)
    used = colours or estimated_colours(grams, size).best
    value = grams.evidence(used)
    for _ in range(renewals):
        moved = refit(grams, used, grams.lin.z, ())
        found = None
        for share in SHARES:
            there = grams.lin.z + share * (moved.lin.z - grams.lin.z)
            try:
                lin = relinearised(moved.grams if share == 1.0 else grams, used, there, every)
            except FAILURES:
                continue
            found = Grams(lin, observed)
            gain = found.evidence(used) - value
            if gain > 0:
                break
            found = None
        if found is None:
            break
        grams, value = found, value + gain
        if gain < WORTH:
            break
    return refit(grams, used, grams.lin.z, (), steps=0)


def fitted_anew(drawn: Linearised, observed: np.ndarray, colours: dict[int, Colour], renewals: int = RENEWALS) -> Refit:
    """The optimum of the unknowns given some of the readings, from a fit to all of them.

    The evidence, by which :func:`settled` judges a move, has the unknowns integrated out and hardly depends on where
    the line was drawn: by it the fit to all readings would stay where it is. So a move counts here by the misfit to the
    readings that are fitted, and whatever comes of the line, the misfit on it is made smallest. The line is drawn where
    these readings alone say that the nuisance was: the others would move the unknowns by it.

    Parameters
    ----------
    drawn
        Where the fit to all readings is; candidates that it has are left aside.
    observed
        Readings that are fitted, shape (outputs, steps).
    colours
        By channel.
    renewals
        The line is drawn anew so often at most.

    Raises
    ------
    SimulationError
        If the simulation fails where the fit to all readings is.
    """
    here = Grams(replace(drawn, by_effect=drawn.by_effect[..., :0], effects=()), observed)
    moved = refit(here, colours, here.lin.z, ())
    for k in range(renewals):
        way, before = moved.lin.z - here.lin.z, misfit(here, colours)
        if k > 0 and np.all(np.abs(way) < NEAR * moved.sd):
            break
        found = None
        for share in SHARES:
            try:
                lin = relinearised(moved.grams if share == 1.0 else here, colours, here.lin.z + share * way, observed)
            except FAILURES:
                continue
            found = Grams(lin, observed)
            if k == 0 or misfit(found, colours) < before:  # the first line was drawn for other readings: no measure
                break
            found = None
        if found is None:
            break
        here = found
        moved = refit(here, colours, here.lin.z, ())
    return at_rest(moved, colours)


def relinearised(grams: Grams, colours: dict[int, Colour], z: np.ndarray, every: np.ndarray) -> Linearised:
    """The problem linearised anew at ``z`` and at the nuisance that is likely there, given ``every`` reading.

    A straight line that is drawn at the usual persons of a day is wrong for the day that was; and who was there on a
    day is told by that day's readings alone, also where they are kept from all else.
    """
    problem = grams.lin.problem
    around = problem.linearise(z, likely(Grams(grams.lin, every), colours, z))
    return linearised(problem, z, around)


def likely(grams: Grams, colours: dict[int, Colour], z: np.ndarray) -> np.ndarray:
    """Posterior mean of the nuisance where the unknowns are ``z``, standard normal before, (nuisance unknowns,)."""
    product, n = grams.total(colours), grams.n_nuisance
    left = grams.without_nuisance(colours)
    score = product.score[:n] - product.gram[:n, n : n + grams.n_unknown] @ (z / grams.spread)
    return np.asarray(grams.lin.turn @ cho_solve((left.root, True), score))
