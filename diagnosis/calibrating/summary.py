"""From a fit to the figures of ``calibration.json``."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from diagnosis.calibrating.schema import Calibration, Channel, Constant, Pair, Parameter
from diagnosis.calibrating.seen import days_of
from diagnosis.fitting.fit import Fit
from diagnosis.fitting.spread import DOUBT, doubted
from diagnosis.intervals import HALF_WIDTH
from diagnosis.recording import HOUR
from diagnosis.scores import score

TOLD = (0.5, 0.9)
"""Shares of the prior variance that the recording removed: below the first a parameter is hardly told, above the
second it is told well."""
CORRELATED = 0.8
STILL = 2.0
"""An output that moves by less than this many standard deviations of its sensor's noise does not move."""


def summarise(found: Fit, zero_shot: dict[str, float], started_from: str) -> Calibration:
    """The report of a fit."""
    problem = found.problem
    system = problem.system
    count = len(system.parameters)
    covariance = doubted(found.covariance)
    sd = np.sqrt(np.diag(covariance))
    low, value, high = (problem.values(found.z + k * HALF_WIDTH * sd) for k in (-1, 0, 1))
    parameters = [
        Parameter(
            name=one.name,
            description=one.description,
            unit=one.unit,
            prior_min=one.min,
            prior_max=one.max,
            value=float(value[k]),
            low=float(low[k]),
            high=float(high[k]),
            told=float(1 - sd[k] ** 2),
            identified=_identified(1 - sd[k] ** 2),
            at_bound=one.name in found.at_bound,
            zero_shot=zero_shot.get(one.name),
        )
        for k, one in enumerate(system.parameters)
    ]
    first = count + len(problem.effects)
    constants = [
        Constant(
            name=one.name,
            description=one.description,
            factor=float(value[k]),
            low=float(low[k]),
            high=float(high[k]),
        )
        for k, one in enumerate(system.uncertain if problem.constants else (), first)
    ]
    correlation = covariance / np.outer(sd, sd)
    pairs = [
        Pair(first=problem.names[i], second=problem.names[j], correlation=float(correlation[i, j]))
        for i, j in _pairs(count)
        if abs(correlation[i, j]) > CORRELATED
    ]
    return Calibration(
        system=system.name,
        system_hash=system.hash(),
        wider=system.wider,
        fmu_sha256=problem.simulator.fmu.sha256,
        recording=str(problem.recording.path),
        steps=len(problem.time),
        step=problem.recording.step,
        start=problem.recording.start,
        days=days_of(problem.recording, system.output_names),
        replay=problem.replay,
        occupancy=problem.occupancy,
        assumed=problem.drive.assumed,
        replayed=list(problem.drive.replayed),
        started_from=started_from,
        parameters=parameters,
        constants=constants,
        correlated=sorted(pairs, key=lambda pair: -abs(pair.correlation)),
        correlation=correlation.tolist(),
        outputs=_channels(found),
        undeclared=problem.undeclared,
        z=found.z.tolist(),
        covariance=covariance.tolist(),
        widened=DOUBT,
        log_likelihood=found.log_likelihood,
        log_evidence=found.log_evidence,
        converged=found.converged,
        stopped=problem.runner.time_up,
        simulations=found.simulations,
        seconds=found.seconds,
    )


def _identified(told: float) -> str:
    return "well" if told >= TOLD[1] else "partly" if told >= TOLD[0] else "hardly"


def _pairs(count: int) -> Iterator[tuple[int, int]]:
    return ((i, j) for i in range(count) for j in range(i))


def _channels(found: Fit) -> dict[str, Channel]:
    problem, noise = found.problem, found.problem.noise
    parts = np.split(found.residual, np.cumsum(problem.observed.sum(axis=1))[:-1])
    made = {}
    for k, output in enumerate(problem.system.outputs):
        seen = np.isfinite(problem.measured[k])
        if not seen.any():
            continue
        used = bool(problem.observed[k].any())
        scores = score(problem.measured[k], found.around.outputs[k], output.unit)
        made[output.name] = Channel(
            **scores.model_dump(),
            used=used,
            declared=float(problem.floor[k]),
            noise=float(noise.white[k]),
            slow_noise=float(noise.slow[k]),
            slow_hours=float(noise.time[k] / HOUR) if noise.slow[k] > 0 else 0.0,
            chi2=float(np.mean(parts[k] ** 2)) if used else None,
            explained=_explained(problem.measured[k], found.around.outputs[k], problem.floor[k]) if used else None,
        )
    return made


def _explained(measured: np.ndarray, fitted: np.ndarray, noise: float) -> float | None:
    """Share of a series' variance (steps,) that another explains, beyond noise of a standard deviation [unit].

    None where the series and what is left of it are both within :data:`STILL` of that noise: there is nothing to tell.
    """
    seen = np.isfinite(measured)
    moved = max(float(np.var(measured[seen])) - noise**2, 0.0)
    left = max(float(np.mean((measured[seen] - fitted[seen]) ** 2)) - noise**2, 0.0)
    still = (STILL**2 - 1) * noise**2
    return None if max(moved, left) <= still else 1 - left / max(moved, still, 1e-300)
