"""A fit of a recording: the most plausible unknowns, how sure they are, and the errors that are left.

It begins at the base model's fit with the sensors' noise (:func:`diagnosis.fitting.starting.begun`). What a room does
beyond the model would be fitted away by its parameters if that noise were all that may be left. So the errors that are
left are estimated (:func:`diagnosis.fitting.noise.estimated`), and the fit is settled with them, until both stay. Where
nobody counted the persons, it settles by the whole density of the readings (:mod:`diagnosis.fitting.freedom`).

**Doubt.** Parameters also make up for what the model is not, and a fit's own covariance knows no such. What a model
takes for granted is among the unknowns (:mod:`diagnosis.fitting.runs`), but not all of it: weather that was read with
an error, noise that is slower than it looks. How much wider that makes intervals a system's ``verdict.json`` says.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fitting.failures import FAILURES
from diagnosis.fitting.grams import Colour
from diagnosis.fitting.likely import moved
from diagnosis.fitting.linear import Linearisation
from diagnosis.fitting.noise import NoiseModel, estimated
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.refit import Refit, likely, settled
from diagnosis.fitting.starting import PRIOR, begun
from diagnosis.recording import HOUR
from shared.errors import TimeUp
from shared.logs import logger

_log = logger(__name__)
ROUNDS = 4
"""How often the errors that are left are estimated anew, at most."""
STAYS = 0.2
"""Errors stay where they change by less than this share."""


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
        Whether the errors that are left stay, and no line drawn further on made the readings more plausible.
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
    try:
        for k in range(ROUNDS):
            problem.runner.reached((k + 1) / (ROUNDS + 1))
            left = _left(found, colours) if estimate_noise else _declared(problem)
            stays = k > 0 and _same(left, colours)
            if stays:
                break
            colours = left
            found = settled(found.lin, problem.observed, colours, sloped=True)
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


def _finished(found: Refit, colours: dict[int, Colour]) -> Fit:
    """The fit with these errors, at the nuisance that is likely then."""
    lin = found.lin
    parts = [colours.get(k, (float(sd), 0.0, HOUR)) for k, sd in enumerate(lin.problem.floor)]
    problem = lin.problem.with_noise(NoiseModel(*np.array(parts).T))
    around = replace(lin.around, marginal=problem.marginal(lin.around.response))
    residual = problem.residuals(lin.z, around)
    logdet = problem.noise.logdet(problem.observed, problem.time) + around.marginal.logdet
    nuisance, outputs = moved(problem, lin.z, around) or (around.nuisance, problem.simulate(lin.z, around.heights))
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
        converged=found.settled,
        simulations=0,
        seconds=0.0,
    )
