"""What the benchmark of warm and cold starts compares: this package's fit, and two global optimisers of the field.

All minimise the same misfit and are traced: how low it has come, after how many simulations and processor seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import differential_evolution
from scipy.special import ndtr, ndtri

from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import LIMIT, Problem
from diagnosis.fitting.simulations import InProcess, Outcome, Run
from shared.errors import SimulationError


class Spent(Exception):
    """A method has used up its simulations."""


class Counted(InProcess):
    """Simulations in this process, how many there were, and who is shown each."""

    count = 0
    shown: Callable[[Run, Outcome], object] = staticmethod(lambda run, outcome: None)

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`diagnosis.fitting.simulations.Runner`."""
        made = []
        for run in runs:
            self.count += 1
            made += super().map([run])
            self.shown(run, made[-1])
        return made


@dataclass
class Trace:
    """How low a method's misfit has come: simulations, seconds, misfit and error in the parameters, where it fell."""

    problem: Problem
    counted: Counted
    truth: np.ndarray
    limit: float = np.inf
    points: list[tuple[int, float, float, float]] = field(default_factory=list)
    began: float = field(default_factory=time.process_time)
    spent: float = 0.0

    def misfit(self, z: np.ndarray) -> float:
        """Half the sum of squares of the standardised residual and of the prior."""
        if self.counted.count >= self.limit:
            raise Spent
        try:
            residual = self.problem.residuals(z)
        except SimulationError:
            return 1e12
        cost = 0.5 * float(residual @ residual + z @ z)
        self.note(z, cost)
        return cost

    def note(self, z: np.ndarray, cost: float) -> None:
        """Keep a misfit that is lower than all before."""
        if cost < self.best:
            error = float(np.sqrt(np.mean((z - self.truth) ** 2)))
            self.points.append((self.counted.count, time.process_time() - self.began, cost, error))

    @property
    def best(self) -> float:
        """Lowest misfit."""
        return self.points[-1][2] if self.points else np.inf


def local(trace: Trace, start: np.ndarray) -> None:
    """This package's fit from a start."""
    problem, trace.began = trace.problem, time.process_time() - trace.spent

    def shown(run: Run, outcome: Outcome) -> None:
        if not isinstance(outcome, SimulationError):
            residual = problem.standardised(problem.measured - outcome)
            z = problem.unknowns({name: run.parameters[name] for name in problem.names})
            trace.note(z, 0.5 * float(residual @ residual + z @ z))

    trace.counted.shown = shown
    with suppress(SimulationError):
        fit(problem, [("start", start)])
    trace.spent = time.process_time() - trace.began


def evolution(trace: Trace, seed: int) -> None:
    """Differential evolution with scipy's defaults, each parameter by its place in its range."""
    bounds = [(float(ndtr(-LIMIT)), float(ndtr(LIMIT)))] * trace.problem.size
    differential_evolution(lambda place: trace.misfit(ndtri(place)), bounds, rng=seed, polish=False, maxiter=10_000)


def genetic(trace: Trace, seed: int, size: int = 50) -> None:
    """A genetic algorithm: tournaments of three, blend crossover (BLX-0.5), Gaussian mutation, one elite."""
    rng = np.random.default_rng(seed)
    crowd = rng.standard_normal((size, trace.problem.size))
    costs = np.array([trace.misfit(z) for z in crowd])
    while True:
        parents = [rng.integers(size, size=(size, 3)) for _ in range(2)]
        first, second = (crowd[p[np.arange(size), np.argmin(costs[p], axis=1)]] for p in parents)
        children = first + rng.uniform(-0.5, 1.5, first.shape) * (second - first)
        mutated = rng.random(children.shape) < 0.1
        children = np.clip(children + mutated * 0.3 * rng.standard_normal(children.shape), -LIMIT, LIMIT)
        best = int(np.argmin(costs))
        kept, lowest = crowd[best], costs[best]
        costs = np.array([lowest, *(trace.misfit(z) for z in children[1:])])
        crowd = np.vstack([kept, children[1:]])
