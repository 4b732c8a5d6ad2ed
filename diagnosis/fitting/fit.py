"""Fitting: the most plausible unknowns of a problem, and how sure they are.

A round linearises the simulation by the nuisance (:mod:`.nuisance`), which gives the residual its covariance
S, and solves

    minimise |S^(-1/2) (measured - simulated(z))|^2 + |z|^2

with scipy's bounded trust-region least squares. S and the most likely nuisance are then renewed at the new optimum,
until it stays. Alone, that would be the mode over unknowns and nuisance together, which is far from the truth where
there are many nuisances that unknowns multiply (Neyman and Scott 1948). Integrated out, the nuisance adds log|S| to
what is minimised (Laplace), as a parabola from :mod:`diagnosis.fitting.determinant`.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from diagnosis.fitting.determinant import determinant
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.gaussian import factor, root
from diagnosis.fitting.noise import NoiseModel, estimated
from diagnosis.fitting.problem import Linearisation, Problem
from diagnosis.fitting.renewing import pruned, renewed
from diagnosis.fitting.solving import solved
from diagnosis.fitting.spread import between, stretched, swung
from shared.errors import SimulationError, TimeUp
from shared.logs import logger

_log = logger(__name__)
ROUNDS = 16
MOVED = 0.25
"""An optimum that moves less than this between rounds [posterior standard deviations] stays."""
NEAR = 3.0
"""One that moves less than this is near enough for the log determinant to matter."""
LEAPING = 15.0
"""After a round that moved less than this the nuisance may leap: before, the unknowns are what is wrong."""
REUSED = 1.0
"""The parabola of the log determinant is kept for moves up to this [posterior standard deviations]."""


@dataclass(frozen=True)
class Fit:
    """What a fit found.

    Attributes
    ----------
    z
        Unknowns at the optimum, shape (unknowns,).
    covariance
        Of the posterior there, shape (unknowns, unknowns): see :mod:`diagnosis.fitting.spread`.
    cost
        Half the sum of squares of the marginal standardised residual and of ``z``.
    log_likelihood
        Of the measurements at the optimum, the nuisance integrated out.
    log_evidence
        The unknowns integrated out as well (Laplace).
    residual
        Marginal standardised residual, shape (readings,).
    jacobian
        Its derivative by the unknowns, shape (readings, unknowns).
    around
        The linearisation by the nuisance at the optimum.
    problem
        The problem as it was fitted in the end: with estimated noise, without history that nobody feels.
    at_bound
        Names of unknowns that lie on their bounds.
    converged
        Whether the last round left the optimum where it was.
    simulations, seconds
        What it took.
    """

    z: np.ndarray
    covariance: np.ndarray
    cost: float
    log_likelihood: float
    log_evidence: float
    residual: np.ndarray
    jacobian: np.ndarray
    around: Linearisation
    problem: Problem
    at_bound: tuple[str, ...]
    converged: bool
    simulations: int
    seconds: float
    history: tuple[tuple[int, float], ...] = field(default=())

    @property
    def sd(self) -> np.ndarray:
        """Posterior standard deviations of the unknowns, shape (unknowns,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def correlation(self) -> np.ndarray:
        """Posterior correlations of the unknowns, shape (unknowns, unknowns)."""
        return np.asarray(self.covariance / np.outer(self.sd, self.sd))

    def draws(self, count: int, seed: int = 0) -> np.ndarray:
        """Draws of the unknowns from the posterior, shape (count, unknowns)."""
        rng = np.random.default_rng(seed)
        return self.z + rng.standard_normal((count, len(self.z))) @ root(self.covariance).T


def fit(
    problem: Problem,
    starts: Sequence[np.ndarray] | None = None,
    *,
    rounds: int = ROUNDS,
    restless: int = 0,
    estimate_noise: bool = False,
    around: Linearisation | None = None,
) -> Fit:
    """Fit a problem from one or several starts.

    Parameters
    ----------
    starts
        Each (unknowns,); the middle of the prior if none is given. All are fitted with the covariance at the first;
        the best of them goes on.
    rounds
        How often the nuisance's part of the covariance is renewed at most; 0 keeps that of ``around``.
    restless
        How many rounds more at most, as long as the last one moved the unknowns far (:data:`LEAPING`).
    estimate_noise
        Estimate a slow error of each output and by how much its noise exceeds the given one.
    around
        A linearisation to begin with, for example of a fit with fewer effects.

    Raises
    ------
    SimulationError
        If the simulation fails at every start.
    TimeUp
        If the time was up before the first round had ended; after that, a fit ends with the round before.
    """
    began, counted = time.perf_counter(), problem.simulations
    starts = [np.zeros(problem.size)] if starts is None or not len(starts) else [np.asarray(s, float) for s in starts]
    moved = np.inf if around is None else 0.0
    if around is None:
        around = _first(problem, starts)
        problem, around = pruned(problem, around)
    z = _best_start(problem, starts, around)
    converged, near, history = rounds == 0, rounds == 0, []
    path: list[np.ndarray] = []
    bent, information = None, np.eye(problem.size)
    most, round_ = max(rounds, 1) + restless, 0
    try:
        for round_ in range(most):
            if round_ >= max(rounds, 1) and moved < LEAPING:
                break
            problem.runner.reached(round_ / most)
            if rounds:
                z = between(path, z, round_)
                around = renewed(problem, z, around, leaps=moved < LEAPING)
            before = z
            if near and (bent is None or _far(z, bent.z, information) > REUSED):
                bent = determinant(problem, around)
            z, jacobian = solved(problem, z, around, bent, 4 if near else 8)
            information = np.eye(problem.size) + jacobian.T @ jacobian
            moved = _far(z, before, information)
            history.append((problem.simulations - counted, moved))
            path += [z] if near else []
            stays, near = near and moved < MOVED, near or moved < NEAR
            if estimate_noise and (near or round_ == 1):
                noise = _noise(problem, z, around)
                same = _same(noise, problem.noise)
                stays, bent = stays and same, bent if same else None
                problem = problem.with_noise(noise)
                around = replace(around, marginal=problem.marginal(around.response))
            if stays:
                converged, path = True, []
                break
    except (TimeUp, *FAILURES) as error:  # what the rounds before came to is a fit, if one that has not come to rest
        if not history and len(starts) == 1:
            raise
        _log.info("the fit ends after round %d: %s", len(history), error)
    swing, z = swung(path, between(path, z, round_), round_), between(path, z, round_)
    slope = np.zeros(problem.size) if bent is None else bent.slope + bent.root.T @ (bent.root @ (z - bent.z))
    with problem.runner.lifted():
        found = _finish(problem, z, around, slope, converged, history, began, counted)
    return replace(found, covariance=found.covariance + swing)


def _first(problem: Problem, starts: list[np.ndarray]) -> Linearisation:
    """A linearisation at the first start that can be simulated."""
    for k, start in enumerate(starts):
        try:
            return problem.linearise(start)
        except FAILURES:
            if k == len(starts) - 1:
                raise
    raise AssertionError("no start")


def _best_start(problem: Problem, starts: list[np.ndarray], around: Linearisation) -> np.ndarray:
    """Where the best of several starts leads with one covariance for all."""
    if len(starts) == 1:
        return starts[0]
    best: tuple[float, np.ndarray] | None = None
    for start in starts:
        try:
            z, _ = solved(problem, start, around, None, most=5)
            residual = problem.residuals(z, around)
        except FAILURES:
            continue
        except TimeUp:
            if best is None:
                raise
            break
        cost = float(residual @ residual + z @ z)
        if best is None or cost < best[0]:
            best = (cost, z)
    if best is None:
        raise SimulationError(f"none of {len(starts)} starts could be simulated")
    return best[1]


def _far(z: np.ndarray, other: np.ndarray, information: np.ndarray) -> float:
    """Root mean square distance of two points [posterior standard deviations]."""
    return float(np.sqrt((z - other) @ information @ (z - other) / len(z)))


def _noise(problem: Problem, z: np.ndarray, around: Linearisation) -> NoiseModel:
    """Noise of the residual that is left with the most likely nuisance."""
    left = problem.measured - problem.simulate(z, problem.nuisance.heights(problem.likely_nuisance(z, around)))
    base = NoiseModel.white_only(problem.floor)
    return estimated(base, np.where(problem.observed, left, 0.0), problem.observed, problem.time)


def _same(a: NoiseModel, b: NoiseModel) -> bool:
    return bool(np.allclose(np.log(a.sd), np.log(b.sd), atol=0.2))


def _finish(
    problem: Problem,
    z: np.ndarray,
    around: Linearisation,
    slope: np.ndarray,
    converged: bool,
    history: list[tuple[int, float]],
    began: float,
    counted: int,
) -> Fit:
    jacobian = problem.jacobian(z, around, central=True)
    residual = problem.residuals(z, around)
    information = np.eye(problem.size) + jacobian.T @ jacobian
    lower = factor(jacobian.T @ jacobian)
    logdet = problem.noise.logdet(problem.observed, problem.time) + around.marginal.logdet
    likelihood = -0.5 * (float(residual @ residual) + logdet + len(residual) * np.log(2 * np.pi))
    evidence = likelihood - 0.5 * float(z @ z) - float(np.sum(np.log(np.diag(lower))))
    nuisance = problem.likely_nuisance(z, around)
    heights = problem.nuisance.heights(nuisance)
    try:
        outputs = problem.simulate(z, heights)
    except FAILURES:  # the likeliest nuisance cannot be simulated: the one before it could
        nuisance, heights = around.nuisance, around.heights
        outputs = problem.simulate(z, heights)
    final = replace(around, z=z, nuisance=nuisance, heights=heights, outputs=outputs)
    return Fit(
        z=z,
        covariance=stretched(problem, z, around, information, slope),
        cost=0.5 * float(residual @ residual + z @ z),
        log_likelihood=likelihood,
        log_evidence=evidence,
        residual=residual,
        jacobian=jacobian,
        around=final,
        problem=problem,
        at_bound=problem.unknown.at_bound(z),
        converged=converged,
        simulations=problem.simulations - counted,
        seconds=time.perf_counter() - began,
        history=tuple(history),
    )
