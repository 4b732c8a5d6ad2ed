"""Refitting a candidate together with the parameters: nonlinear, because parameters that compensate move far.

Gauss-Newton on the likelihood with the nuisance integrated out, each step a small bounded least-squares problem
(scipy's ``lsq_linear``); the response to the nuisance is kept. Derivatives are corrected by what each step shows
(Broyden 1965, Mathematics of Computation 19:577) and simulated anew where that no longer helps, and at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.optimize import lsq_linear

from diagnosis.effects import Effect
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.gaussian import factor
from diagnosis.fitting.problem import Problem
from diagnosis.gap.grams import AMPLITUDE, Colour, Grams
from diagnosis.gap.linear import Linearised, linearised
from diagnosis.gap.scan import mass

STEPS = 8
SETTLED = 0.05
"""A step that promises less gain in log likelihood than this ends the search."""
RESTING = 30
"""Steps, at most, of what is told."""
TELLING = 1e-4
"""A step shorter than this [prior standard deviations] corrects no derivative: what it shows is the integrator's error,
and divided by a step that is but the rounding of a bound that would be a derivative of any size."""
REST = 5e-4
"""The same, where the optimum itself is asked for: within a thirtieth of a standard deviation."""


@dataclass(frozen=True)
class Refit:
    """Effects fitted with the parameters.

    ``lin`` is the linearised problem there, without further candidates, ``grams`` its products; ``evidence`` with
    the colours of the null; ``sd`` (unknowns,) of the posterior; ``settled``: whether no step promised more.
    """

    lin: Linearised
    grams: Grams
    evidence: float
    sd: np.ndarray
    settled: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects."""
        return tuple(one.name for one in self.lin.chosen)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of unknowns that lie on their bounds."""
        return self.lin.problem.unknown.at_bound(self.lin.z)

    def evidence_with(self, colours: dict[int, Colour]) -> float:
        """Log evidence with other colours, of amplitudes within their bounds.

        A prior that is cut off is denser where it is left, and what the readings allow counts only there; of two
        amplitudes each by itself.
        """
        grams = self.grams
        product = grams.total(colours)
        root = factor(product.gram)
        mean = cho_solve((root, True), product.score)
        first = grams.n_nuisance + len(self.lin.problem.system.parameters)
        value = grams.evidence(colours)
        for k, effect in enumerate(self.lin.chosen):
            unit = np.zeros(len(mean))
            unit[first + k] = 1.0
            sd = float(np.linalg.norm(solve_triangular(root, unit, lower=True)))
            # in units of the prior's spread, as the columns are
            bounds = np.array([effect.lower, effect.upper]) / effect.scale / grams.spread[first - grams.n_nuisance + k]
            around = (bounds - mean[first + k]) / sd
            value += float(mass(around[0], around[1]) - mass(bounds[0], bounds[1]))
        return value


def refit(
    before: Grams,
    colours: dict[int, Colour],
    start: np.ndarray,
    new: Sequence[Effect],
    *,
    steps: int = STEPS,
    redrawn: bool = True,
) -> Refit:
    """Fit further effects from a start (unknowns with the new amplitudes after the old ones,), in ``steps`` at most.

    Without ``redrawn`` derivatives are corrected and never simulated anew: for a ranking.

    Raises
    ------
    SimulationError
        If the simulation fails on all the way.
    """
    problem = before.lin.problem.with_effects([*before.lin.chosen, *new])
    z = np.clip(start, *inner(problem))
    here, exact = _begun(problem, z, before.lin, new)
    cost = _cost(here, before, colours)
    settled = False
    for _ in range(steps):
        step, promised = step_from(here, before, colours)
        settled = promised < SETTLED
        if settled and exact:
            break
        moved = None
        for share in () if settled else (1.0, 0.4, 0.15):
            try:
                there = _at(problem, here.z + share * step, here)
            except FAILURES:
                continue
            value = _cost(there, before, colours)
            if value < cost - 1e-3:
                moved = (there, value)
                break
        if moved is not None:
            here, exact, cost = moved[0], False, moved[1]
        elif exact or not redrawn:
            break
        else:
            here, exact = _at(problem, here.z, here, derivatives=True), True
    if not exact and redrawn:
        here = _at(problem, here.z, here, derivatives=True)
    settled = settled or step_from(here, before, colours)[1] < 20 * SETTLED
    grams = Grams(here, before.observed, before)
    left = grams.without_nuisance(colours)
    covariance = cho_solve((factor(left.information), True), np.eye(grams.n_unknown))
    found = Refit(here, grams, 0.0, np.sqrt(np.diag(covariance)) * grams.spread, settled)
    return replace(found, evidence=found.evidence_with(colours))


def at_rest(one: Refit, colours: dict[int, Colour], *, steps: int = STEPS) -> Refit:
    """The same where the search left off, gone on with until nothing is to be gained: it ends within a share of a sd.

    Steps as short as a twentieth are tried: what an effect does may bend within one, such as an input that is moved
    past the reading's hour, and a search that ends there ends beside the trough.

    ``evidence`` and ``sd`` are those of where it began.
    """
    here, exact, cost = one.lin, True, _cost(one.lin, one.grams, colours)
    for _ in range(steps):
        step, promised = step_from(here, one.grams, colours)
        moved = None
        for share in (1.0, 0.4, 0.15, 0.05) if promised > REST else ():
            try:
                there = _at(here.problem, here.z + share * step, here)
            except FAILURES:
                continue
            value = _cost(there, one.grams, colours)
            if value < cost:
                moved = (there, value)
                break
        if moved is not None:
            here, exact, cost = moved[0], False, moved[1]
            continue
        if exact:
            break
        here, exact = _at(here.problem, here.z, here, derivatives=True), True
    grams = one.grams if here is one.lin else Grams(here, one.grams.observed, one.grams)
    return replace(one, lin=here, grams=grams)


def rested(one: Refit, colours: dict[int, Colour]) -> Refit:
    """The same at its optimum, with the spread that it has there.

    A refit takes few steps, and one that ends early may be judged the better for it: its straight line promises more
    than there is. That is no matter among candidates, which all end so, but the size that is told of one would be that
    of where its steps had come to, with the interval of an optimum. ``evidence`` stays what it was judged by.

    Raises
    ------
    SimulationError
        If the simulation fails where the derivatives are asked for.
    """
    there = at_rest(one, colours, steps=RESTING)
    if there.lin is one.lin:
        return one
    done = refit(there.grams, colours, there.lin.z, (), steps=0)
    return replace(done, evidence=one.evidence)


def misfit(grams: Grams, colours: dict[int, Colour]) -> float:
    """What a refit makes smallest, at the point where the line was drawn."""
    return _cost(grams.lin, grams, colours)


def inner(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the unknowns, shape (unknowns,) each, a little inside of them."""
    low, high = problem.bounds
    margin = np.where(np.isfinite(high - low), 1e-6 * (high - low), 0.0)
    return low + margin, high - margin


def _begun(problem: Problem, z: np.ndarray, before: Linearised, new: Sequence[Effect]) -> tuple[Linearised, bool]:
    """The start, with derivatives that are exact where nothing has moved, and else those from before, corrected."""
    if not new and np.array_equal(z, before.z):
        return replace(before, by_effect=before.by_effect[..., :0], effects=()), True
    names = [one.name for one in before.effects]
    if any(one.name not in names for one in new):
        return _at(problem, z, before, derivatives=True), True
    first = len(problem.system.parameters) + len(before.chosen)
    places = [names.index(one.name) for one in new]
    known = np.concatenate(
        [before.by_unknown[..., :first], before.by_effect[..., places], before.by_unknown[..., first:]], axis=2
    )
    at = np.concatenate([before.z[:first], np.zeros(len(new)), before.z[first:]])
    return _at(problem, z, replace(before, problem=problem, by_unknown=known, z=at)), False


def _at(problem: Problem, z: np.ndarray, near: Linearised, *, derivatives: bool = False) -> Linearised:
    """The problem at ``z``; without ``derivatives`` those of a point near, with Broyden's (1965) correction."""
    z = np.clip(z, *inner(problem))
    known = None if derivatives else near.by_unknown
    made = linearised(problem, z, near.around, (), known, near)
    if derivatives:
        return made
    way = z - near.z
    if way @ way < TELLING**2:
        return made
    missed = made.outputs - near.outputs - near.by_unknown @ way
    return replace(made, by_unknown=near.by_unknown + missed[..., None] * way / (way @ way))


def _cost(lin: Linearised, before: Grams, colours: dict[int, Colour]) -> float:
    """Half the square of the residual at ``z``, nuisance integrated out, and of the unknowns."""
    grams = Grams(replace(lin, by_unknown=np.zeros((*lin.residual.shape, 0)), z=np.zeros(0)), before.observed, before)
    left = grams.without_nuisance(colours)
    return 0.5 * (left.square + float(np.sum((lin.z / _spread(lin)) ** 2)))


def _spread(lin: Linearised) -> np.ndarray:
    first = len(lin.problem.system.parameters)
    spread = np.ones(len(lin.z))
    spread[first : first + len(lin.chosen)] = AMPLITUDE
    return spread


def step_from(lin: Linearised, before: Grams, colours: dict[int, Colour]) -> tuple[np.ndarray, float]:
    """Best step within bounds, shape (unknowns,), and the gain in log likelihood that it promises."""
    grams = Grams(lin, before.observed, before)
    left = grams.without_nuisance(colours)
    root = factor(left.information)
    low, high = (bound / grams.spread for bound in lin.problem.bounds)
    target = solve_triangular(root, left.score, lower=True)
    found = lsq_linear(root.T, target, (low, high)).x
    now = lin.z / grams.spread
    gain = 0.5 * float(np.sum((root.T @ now - target) ** 2) - np.sum((root.T @ found - target) ** 2))
    return (found - now) * grams.spread, gain


def linear_start(grams: Grams, colours: dict[int, Colour], new: Sequence[int]) -> np.ndarray:
    """Where the linearised problem sees the optimum with further effects, shape (unknowns + new,).

    Parameters
    ----------
    new
        Places among the candidate effects.
    """
    lin = grams.lin
    inner = grams.inner
    places = np.concatenate([inner, [grams.outer[j] for j in new]]).astype(int)
    scale = np.concatenate([np.ones(len(inner)), np.full(len(new), AMPLITUDE)])
    product = grams.total(colours)
    gram = product.gram[np.ix_(places, places)] * np.outer(scale, scale)
    x = cho_solve((factor(gram), True), product.score[places] * scale)
    unknowns = x[grams.n_nuisance : len(inner)] * grams.spread
    amplitudes = x[len(inner) :] * AMPLITUDE
    first = len(lin.problem.system.parameters) + len(lin.chosen)
    # a straight line is trusted for a way, not to the end of the world
    unknowns = lin.z + np.clip(unknowns - lin.z, -1.5, 1.5)
    return np.concatenate([unknowns[:first], amplitudes, unknowns[first:]])
