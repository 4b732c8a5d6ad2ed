"""Fits of unknowns, with the nuisance integrated out along a straight line.

**A fit on one line** (:func:`refit`): the simulation is linearised by the nuisance, whose response is kept, and the
unknowns are found by Gauss-Newton steps on the likelihood with the nuisance integrated out, each a small bounded
least-squares problem (scipy's ``lsq_linear``). Parameters that compensate move far, so every step is simulated.
Derivatives are corrected by what a step shows (Broyden 1965, Mathematics of Computation 19:577) and simulated anew
where that no longer helps.

**A line holds near where it was drawn.** Persons who come within a step, a controller that saturates and air that is
changed twice an hour bend it, and what the bend leaves behind looks like a gap. So a fit is settled (:func:`settled`):
the line is drawn anew where unknowns and nuisance have moved to, for as long as the readings become more plausible
with the nuisance integrated out. From a start, the base model is first led by lines at the usual nuisance
(:func:`base_from`): what the readings say of persons at parameters that are far off is fiction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.optimize import lsq_linear

from diagnosis.effects import Effect
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.freedom import corrected, half_logdet, slope_of
from diagnosis.fitting.gaussian import factor, mass
from diagnosis.fitting.grams import AMPLITUDE, Colour, Grams, estimated_colours
from diagnosis.fitting.likely import pruned
from diagnosis.fitting.lines import Linearised, linearised, metered, widened
from diagnosis.fitting.problem import Problem
from shared.errors import TimeUp

LINES = 8
"""How often a line is drawn anew, at most."""
LEAST = 0.03
"""A line that gains less in log density is the last: within a quarter of a standard deviation of one unknown."""
SHARES = (1.0, 0.4)
"""Of a move to where the straight line sees the optimum."""


def settled(
    first: Linearised, observed: np.ndarray, colours: dict[int, Colour] | None = None, *, sloped: bool = False
) -> Refit:
    """The most plausible unknowns with the nuisance integrated out, linearised where they are.

    Each line leads to its own optimum, or part of the way: as far as the readings become more plausible when the line
    is drawn there.

    Parameters
    ----------
    first
        Where to begin; candidates that it has are left aside, its derivatives may be those of a point near.
    observed
        Readings that count, shape (outputs, steps).
    colours
        By channel; estimated on the first line if not given.
    sloped
        Whether steps follow how the freedom of persons whom nobody counted changes (:mod:`.freedom`).
    """
    size, first = first.problem.floor, replace(first, by_effect=first.by_effect[..., :0], effects=())
    grams = Grams(first, observed)
    try:
        here = Grams(relinearised(grams, colours or estimated_colours(grams, size).best, first.z, observed), observed)
    except FAILURES:  # what is likely on the straight line may be nothing that the model can be run with
        here = Grams(linearised(first.problem, first.z, first.around), observed)
    used = colours or estimated_colours(here, size).best
    if sloped:
        here = Grams(replace(here.lin, slope=slope_of(here, used)), observed, here)
    value, rests = _density(here, used), False
    for _ in range(LINES):
        moved, gain = refit(here, used, here.lin.z, (), redrawn=False), np.nan
        for share in SHARES:
            there = here.lin.z + share * (moved.lin.z - here.lin.z)
            try:
                drawn = Grams(relinearised(moved.grams if share == 1.0 else here, used, there, observed), observed)
            except FAILURES:
                continue
            drawn = corrected(here, drawn, used)
            gain = _density(drawn, used) - value
            if gain > 0:
                here, value = drawn, value + gain
                break
        rests = bool(gain < LEAST)  # not where no line could be drawn: then there is no gain to tell
        if rests or np.isnan(gain):
            break
    return replace(refit(here, used, here.lin.z, (), steps=0), settled=rests)


def _density(grams: Grams, colours: dict[int, Colour]) -> float:
    """Log density of readings and unknowns where the line is drawn, nuisance integrated out, but for a constant."""
    return -misfit(grams, colours) - half_logdet(grams, colours)


def relinearised(grams: Grams, colours: dict[int, Colour], z: np.ndarray, every: np.ndarray) -> Linearised:
    """The problem linearised anew at ``z`` and at the nuisance that is likely there, given ``every`` reading.

    A straight line that is drawn at the usual persons of a day is wrong for the day that was; and who was there on a
    day is told by that day's readings alone, also where they are kept from all else.
    """
    problem = grams.lin.problem
    around = problem.linearise(z, likely(Grams(grams.lin, every), colours, z))
    return replace(linearised(problem, z, around), slope=grams.lin.slope)


def likely(grams: Grams, colours: dict[int, Colour], z: np.ndarray) -> np.ndarray:
    """Posterior mean of the nuisance where the unknowns are ``z``, standard normal before, (nuisance unknowns,)."""
    product, n = grams.total(colours), grams.n_nuisance
    left = grams.without_nuisance(colours)
    score = product.score[:n] - product.gram[:n, n : n + grams.n_unknown] @ (z / grams.spread)
    return np.asarray(grams.lin.turn @ cho_solve((left.root, True), score))


STEPS = 8
SETTLED = 0.05
"""A step that promises less gain in log likelihood than this ends the search."""
TELLING = 1e-4
"""A step shorter than this [prior standard deviations] corrects no derivative: what it shows is the integrator's error,
and divided by a step that is but the rounding of a bound that would be a derivative of any size."""


@dataclass(frozen=True)
class Refit:
    """Effects fitted with the parameters.

    ``lin`` is the linearised problem there, without further candidates, ``grams`` its products; ``evidence`` with
    the colours of the null; ``covariance`` (unknowns, unknowns) of the posterior; ``settled``: whether no step, or of a
    fit whose line is drawn anew no line, promised more; ``exact``: whether its derivatives were simulated there.
    """

    lin: Linearised
    grams: Grams
    evidence: float
    covariance: np.ndarray
    settled: bool
    exact: bool

    @property
    def sd(self) -> np.ndarray:
        """Posterior standard deviations of the unknowns, shape (unknowns,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

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
    least = cost(Grams(here, before.observed, before), colours)
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
            value = cost(Grams(there, before.observed, before), colours)
            if value < least - 1e-3:
                moved = (there, value)
                break
        if moved is not None:
            here, exact, least = moved[0], False, moved[1]
        elif exact or not redrawn:
            break
        else:
            here, exact = _at(problem, here.z, here, derivatives=True), True
    if not exact and redrawn:
        here, exact = _at(problem, here.z, here, derivatives=True), True
    settled = settled or step_from(here, before, colours)[1] < 20 * SETTLED
    grams = Grams(here, before.observed, before)
    left = grams.without_nuisance(colours)
    covariance = cho_solve((factor(left.information), True), np.eye(grams.n_unknown))
    covariance *= np.outer(grams.spread, grams.spread)
    found = Refit(here, grams, 0.0, covariance, settled, exact)
    return replace(found, evidence=found.evidence_with(colours))


def misfit(grams: Grams, colours: dict[int, Colour]) -> float:
    """Half the square of the residual, nuisance integrated out, and of the unknowns, where the line was drawn."""
    lin = grams.lin
    here = replace(lin, by_unknown=np.zeros((*lin.residual.shape, 0)), z=np.zeros(0))
    left = Grams(here, grams.observed, grams).without_nuisance(colours)
    return 0.5 * (left.square + float(np.sum((lin.z / grams.spread) ** 2)))


def cost(grams: Grams, colours: dict[int, Colour]) -> float:
    """What a refit makes smallest: the misfit, and by the line's slope what the unknowns cost."""
    slopes, where = grams.lin.slopes
    return misfit(grams, colours) + float(slopes @ (grams.lin.z - where))


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


LEADS = 3
"""Lines, at most, by which the base model is led from a start."""
AWAY = 1.0
"""Root mean square way [posterior standard deviations] from which the next is drawn: a line at the usual nuisance leads
safely from afar, and ends beside the optimum."""
FAR = 5.0
"""The same from which a line is no ground to compare models on: where the base model is hundreds in log evidence below
its optimum, candidates differ by how they get away from there."""


def line_at(plain: Problem, start: np.ndarray, *, wide: bool = True) -> Linearised:
    """A problem linearised at a start and at the usual nuisance.

    What the readings say of the nuisance at parameters that are far off is fiction, and fits begun on it end far off.

    Parameters
    ----------
    plain
        Before any fit.
    start
        Unknowns, shape (unknowns,).
    wide
        Whether nuisances have the tails that a test needs (:func:`.lines.widened`).

    Raises
    ------
    SimulationError
        If it cannot be simulated there.
    """
    problem, around = (widened if wide else metered)(*pruned(plain, plain.linearise(start)))
    return linearised(problem, start, around)


def base_from(line: Linearised, observed: np.ndarray) -> tuple[Refit, Linearised]:
    """The base model's optimum, led to from a start and settled there, and the line on which its rivals begin.

    That is the one at the start, or the first that leads the base model no further than :data:`FAR`.

    Where the time is up on the way, or the way cannot be simulated, it is where the line led.

    Parameters
    ----------
    line
        At the start, without effects.
    observed
        Readings that count, shape (outputs, steps).

    Raises
    ------
    TimeUp
        If the time was up before the line had led anywhere.
    """
    led, start = _led(line, observed), line
    try:
        for _ in range(LEADS - 1):
            way = float(np.sqrt(np.mean(((led.lin.z - line.z) / led.sd) ** 2)))
            if way < AWAY:
                break
            line = linearised(line.problem, led.lin.z, line.problem.linearise(led.lin.z))
            start = line if way > FAR else start
            led = _led(line, observed)
        return settled(led.lin, observed), start
    except (TimeUp, *FAILURES):
        return led, start


def _led(line: Linearised, observed: np.ndarray) -> Refit:
    """Where a line leads the base model, with the colours that it sees."""
    grams = Grams(line, observed)
    return refit(grams, estimated_colours(grams, line.problem.floor).best, line.z, (), redrawn=False)
