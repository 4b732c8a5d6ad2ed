"""A fit of a recording: the most plausible unknowns, how sure they are, and the errors that are left.

It begins at the base model's fit on straight lines (:func:`diagnosis.fitting.starting.begun`) and goes to where the
measurements are most plausible with the nuisance integrated out, its covariance following the unknowns
(:mod:`diagnosis.fitting.determinant`). What a room does beyond the model would be fitted away by its parameters if the
sensors' noise were all that may be left. So the errors that are left are estimated
(:func:`diagnosis.fitting.noise.estimated`), and the fit is settled with them, until both stay.

**Doubt.** Parameters also make up for what the model is not, and a fit's own covariance knows no such. What a model
takes for granted is among the unknowns (:mod:`diagnosis.fitting.runs`), but not all of it: weather that was read with
an error, noise that is slower than it looks. How much wider that makes intervals a system's ``verdict.json`` says.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fitting.determinant import determinant
from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.gaussian import Parabola
from diagnosis.fitting.grams import Colour, Grams
from diagnosis.fitting.likely import moved
from diagnosis.fitting.linear import Linearisation
from diagnosis.fitting.noise import NoiseModel, estimated
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import NEAR, SHARES, Refit, likely, misfit, refit, relinearised, step_from
from diagnosis.fitting.starting import PRIOR, begun
from diagnosis.recording import HOUR
from shared.errors import TimeUp
from shared.logs import logger

_log = logger(__name__)
ROUNDS = 4
"""How often the errors that are left are estimated anew, at most."""
STAYS = 0.2
"""Errors stay where they change by less than this share."""
LINES = 8
"""How often a line is drawn anew for the same errors, at most."""
LEAST = 0.03
"""A line that gains less in log density is the last: within a quarter of a standard deviation of one unknown."""
REUSED = 1.0
"""The determinant is simulated anew where the fit has moved further [its standard deviations, root mean square]."""


def doubted(covariance: np.ndarray, doubt: float) -> np.ndarray:
    """Covariance (unknowns, unknowns) of a posterior whose prior is standard normal, its recording doubted.

    A recording's information counts for 1 / ``doubt``^2. Correlations are those of the doubted posterior as a whole,
    standard deviations those of :func:`doubted_sd`: as a whole the prior holds together what the recording hardly tells
    apart, and intervals came out too narrow.
    """
    prior = np.eye(len(covariance))
    whole = np.linalg.inv(prior + (np.linalg.inv(covariance) - prior) / doubt**2)
    scale = doubted_sd(np.sqrt(np.diag(covariance)), doubt) / np.sqrt(np.diag(whole))
    return np.asarray(whole * np.outer(scale, scale))


def doubted_sd(sd: np.ndarray, doubt: float) -> np.ndarray:
    """Standard deviations (unknowns,) of such a posterior, each by itself: the prior keeps its say."""
    told = np.maximum(np.asarray(sd) ** -2.0 - 1.0, 0.0)
    return np.asarray(1.0 / np.sqrt(1.0 + told / doubt**2))


@dataclass(frozen=True)
class Fit:
    """What a fit found.

    Attributes
    ----------
    z
        Unknowns at the optimum, shape (unknowns,).
    covariance
        Of the posterior there, shape (unknowns, unknowns).
    log_likelihood
        Of the measurements at the optimum, the nuisance integrated out.
    log_evidence
        The unknowns integrated out as well (Laplace).
    residual
        Marginal standardised residual, shape (readings,).
    around
        The linearisation by the nuisance at the optimum, with the most likely nuisance and the outputs there.
    problem
        The problem as it was fitted in the end: with estimated noise, without history that nobody feels.
    started_from
        Which of the starts led there.
    at_bound
        Names of unknowns that lie on their bounds.
    converged
        Whether the errors that are left stay, and the last line's optimum is within :data:`.refit.NEAR` standard
        deviations (root mean square).
    simulations, seconds
        What it took.
    """

    z: np.ndarray
    covariance: np.ndarray
    log_likelihood: float
    log_evidence: float
    residual: np.ndarray
    around: Linearisation
    problem: Problem
    started_from: str
    at_bound: tuple[str, ...]
    converged: bool
    simulations: int
    seconds: float

    @property
    def sd(self) -> np.ndarray:
        """Posterior standard deviations of the unknowns, shape (unknowns,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def fit(
    problem: Problem, starts: Sequence[tuple[str, np.ndarray]] | None = None, *, estimate_noise: bool = False
) -> Fit:
    """Fit a problem from one or several starts.

    Parameters
    ----------
    starts
        What each is called, and its unknowns (unknowns,); the middle of the prior if not given. All are tried until a
        fit leaves hardly more than the noise; the most plausible is taken.
    estimate_noise
        Estimate by how much each output's error exceeds its sensor's noise, and how slow it is.

    Raises
    ------
    SimulationError
        If the simulation fails at every start.
    TimeUp
        If the time was up before there was a fit; after that, a fit ends with what there is.
    """
    began, counted = time.perf_counter(), problem.simulations
    first = begun(problem, starts or [(PRIOR, np.zeros(problem.size))], wide=False)
    found, colours, stays = first.fit, first.colours, False
    bent: Parabola | None = None
    try:
        for k in range(ROUNDS):
            problem.runner.reached((k + 1) / (ROUNDS + 1))
            left = _left(found, colours) if estimate_noise else _declared(problem)
            stays = k > 0 and _same(left, colours)
            if stays:
                break
            colours = left
            found, bent = _settled(found, colours, bent)
    except (TimeUp, *FAILURES) as error:
        _log.info("the fit ends before its errors stay: %s", error)
    with problem.runner.lifted():
        made = _finished(found, colours)
    return replace(
        made,
        started_from=first.name,
        converged=made.converged and stays and not problem.runner.time_up,
        simulations=problem.simulations - counted,
        seconds=time.perf_counter() - began,
    )


def _declared(problem: Problem) -> dict[int, Colour]:
    """The sensors' noise, white."""
    return {k: (float(sd), 0.0, HOUR) for k, sd in enumerate(problem.floor) if problem.observed[k].any()}


def _left(found: Refit, colours: dict[int, Colour]) -> dict[int, Colour]:
    """The errors that a fit leaves with the most likely nuisance."""
    problem = found.lin.problem
    nuisance = problem.nuisance.heights(likely(found.grams, colours, found.lin.z))
    left = np.where(problem.observed, problem.measured - problem.simulate(found.lin.z, nuisance), 0.0)
    noise = estimated(NoiseModel.white_only(problem.floor), left, problem.observed, problem.time)
    own = zip(noise.white.tolist(), noise.slow.tolist(), noise.time.tolist(), strict=True)
    return {k: one for k, one in enumerate(own) if problem.observed[k].any()}


def _same(one: dict[int, Colour], other: dict[int, Colour]) -> bool:
    """Whether all errors are about as large."""
    return all(abs(np.log(np.hypot(*one[k][:2]) / np.hypot(*other[k][:2]))) < STAYS for k in one)


def _settled(begin: Refit, colours: dict[int, Colour], bent: Parabola | None) -> tuple[Refit, Parabola]:
    """The most plausible unknowns with the nuisance integrated out, and the determinant near there.

    Each line leads to its own optimum, or part of the way: as far as the measurements become more plausible when the
    line is drawn there.
    """
    observed = begin.grams.observed
    here = Grams(relinearised(begin.grams, colours, begin.lin.z, observed), observed)
    value, sd, near = _density(here, colours), begin.sd, bent or determinant(here, colours)
    for _ in range(LINES):
        if np.sqrt(np.mean(((here.lin.z - near.z) / sd) ** 2)) > REUSED:
            near = determinant(here, colours)
        moved = refit(Grams(here.lin, observed, here, near), colours, here.lin.z, ())
        sd, gain = moved.sd, 0.0
        for share in SHARES:
            there = here.lin.z + share * (moved.lin.z - here.lin.z)
            try:
                drawn = Grams(relinearised(moved.grams if share == 1.0 else here, colours, there, observed), observed)
            except FAILURES:
                continue
            gain = _density(drawn, colours) - value
            if gain > 0:
                here, value = drawn, value + gain
                break
        if gain < LEAST:
            break
    return refit(Grams(here.lin, observed, here, near), colours, here.lin.z, (), steps=0), near


def _density(grams: Grams, colours: dict[int, Colour]) -> float:
    """Log density of measurements and unknowns where the line is drawn, nuisance integrated out, but for a constant."""
    root = grams.without_nuisance(colours).root
    return -misfit(grams, colours) - float(np.sum(np.log(np.diag(root))))


def _finished(found: Refit, colours: dict[int, Colour]) -> Fit:
    """The fit with these errors, at the nuisance that is likely then."""
    lin = found.lin
    parts = [colours.get(k, (float(sd), 0.0, HOUR)) for k, sd in enumerate(lin.problem.floor)]
    problem = lin.problem.with_noise(NoiseModel(*np.array(parts).T))
    around = replace(lin.around, marginal=problem.marginal(lin.around.response))
    residual = problem.residuals(lin.z, around)
    logdet = problem.noise.logdet(problem.observed, problem.time) + around.marginal.logdet
    nuisance, outputs = moved(problem, lin.z, around) or (around.nuisance, problem.simulate(lin.z, around.heights))
    step, _ = step_from(lin, found.grams, colours)
    away = float(np.sqrt(np.mean((step / found.sd) ** 2)))
    return Fit(
        z=lin.z,
        covariance=found.covariance,
        log_likelihood=-0.5 * (float(residual @ residual) + logdet + len(residual) * np.log(2 * np.pi)),
        log_evidence=found.evidence_with(colours),
        residual=residual,
        around=replace(around, z=lin.z, nuisance=nuisance, heights=problem.nuisance.heights(nuisance), outputs=outputs),
        problem=problem,
        started_from="",
        at_bound=found.at_bound,
        converged=away < NEAR,
        simulations=0,
        seconds=0.0,
    )
