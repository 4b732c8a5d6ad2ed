"""Warm against cold start: simulations and seconds until the same misfit, beside global optimisers of the field.

    python tests/benchmarks/warm_start.py fmus/MixedAirCO2 --run RUN --systems 50

For each unseen recording the target misfit is the lowest that any method found, plus ``--slack`` per cent. ``warm``
starts from the estimator, ``cold`` from draws of the prior, both by this package's fit; ``evolution`` is differential
evolution and ``genetic`` a genetic algorithm (tournaments, blend crossover, Gaussian mutation, one elite), both on the
same misfit: squares of residuals by noise, with the persons as they were counted. ``zero-shot`` is the
estimator alone: its seconds, its misfit, and the seconds that the cold start needed to get as low.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.optimize import differential_evolution

from datagen import simulate
from datagen.simulator import Simulator
from diagnosis.calibrating.calibration import estimate
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import LIMIT, Problem
from diagnosis.recording import read_recording
from diagnosis.fitting.side_by_side import InProcess, Outcome, Run
from shared.errors import SimulationError
from shared.system import load_system

METHODS = ["cold", "warm", "evolution", "genetic"]


class Counted(InProcess):
    """Simulations in this process, and how many there were."""

    count = 0

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`diagnosis.fitting.side_by_side.Runner`."""
        self.count += len(runs)
        return super().map(runs)


@dataclass
class Trace:
    """Misfit by simulations and seconds; asked at every evaluation that a method pays for."""

    problem: Problem
    counted: Counted
    limit: int
    points: list[tuple[int, float, float]] = field(default_factory=list)
    began: float = field(default_factory=time.perf_counter)

    def misfit(self, z: np.ndarray) -> float:
        """Half the sum of squares of the standardised residual and of the prior."""
        if self.counted.count >= self.limit:
            raise StopIteration
        try:
            residual = self.problem.residuals(z)
            cost = 0.5 * float(residual @ residual + z @ z)
        except SimulationError:
            cost = 1e12
        self.points.append((self.counted.count, time.perf_counter() - self.began, cost))
        return cost

    @property
    def best(self) -> float:
        """Lowest misfit."""
        return min((cost for _, _, cost in self.points), default=np.inf)

    def reached(self, target: float) -> tuple[float, float]:
        """Simulations and seconds until a misfit; infinite if never."""
        return next(((n, s) for n, s, cost in self.points if cost <= target), (np.inf, np.inf))


def local(start: np.ndarray) -> Callable[[Trace], None]:
    """This package's fit from a start."""

    def run(trace: Trace) -> None:
        plain = trace.problem.residuals

        def watched(z: np.ndarray, around: object = None) -> np.ndarray:
            made = plain(z, around)  # type: ignore[arg-type]
            cost = 0.5 * float(made @ made + z @ z)
            trace.points.append((trace.counted.count, time.perf_counter() - trace.began, cost))
            return made

        trace.problem.residuals = watched  # type: ignore[method-assign]
        fit(trace.problem, [start])

    return run


def evolution(seed: int) -> Callable[[Trace], None]:
    """Differential evolution with scipy's defaults."""

    def run(trace: Trace) -> None:
        bounds = [(-LIMIT, LIMIT)] * trace.problem.size
        differential_evolution(trace.misfit, bounds, rng=seed, polish=False, maxiter=10_000)

    return run


def genetic(seed: int, size: int = 50) -> Callable[[Trace], None]:
    """A genetic algorithm: tournaments of three, blend crossover (BLX-0.5), Gaussian mutation, one elite."""

    def run(trace: Trace) -> None:
        rng = np.random.default_rng(seed)
        crowd = rng.standard_normal((size, trace.problem.size))
        costs = np.array([trace.misfit(z) for z in crowd])
        while True:
            parents = [rng.integers(size, size=(size, 3)) for _ in range(2)]
            first, second = (crowd[p[np.arange(size), np.argmin(costs[p], axis=1)]] for p in parents)
            children = first + rng.uniform(-0.5, 1.5, first.shape) * (second - first)
            mutated = rng.random(children.shape) < 0.1
            children = np.clip(children + mutated * 0.3 * rng.standard_normal(children.shape), -LIMIT, LIMIT)
            children[0] = crowd[np.argmin(costs)]
            crowd, costs = children, np.array([trace.misfit(z) for z in children])

    return run


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system", type=Path)
    parser.add_argument("--run", type=Path)
    parser.add_argument("--systems", type=int, default=3)
    parser.add_argument("--hours", type=float, default=168.0)
    parser.add_argument("--seed", type=int, default=9200, help="root seed; take one that no estimator was trained on")
    parser.add_argument("--limit", type=int, default=3000, help="simulations that a method may spend")
    parser.add_argument("--slack", type=float, default=5.0, help="per cent above the best misfit that count as reached")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=METHODS)
    parser.add_argument("--out", type=Path, default=Path("warm-start"))
    options = parser.parse_args()
    system = load_system(options.system).with_experiment(hours=options.hours)
    simulator = Simulator(system)
    options.out.mkdir(parents=True, exist_ok=True)
    found: dict[str, list[tuple[float, float]]] = {}
    for index in range(options.systems):
        path = options.out / f"system-{index}.nc"
        simulate(system, seed=options.seed, index=index, out=path)
        record = read_recording(path, system)
        rng = np.random.default_rng([options.seed, index])
        record.outputs[:] += system.noise_sd("sensor")[:, None] * rng.standard_normal(record.outputs.shape)
        noisy = xr.load_dataset(path, decode_times=False)
        for name, values in zip(system.output_names, record.outputs, strict=True):
            noisy[name].values[:] = values
        noisy.to_netcdf(path)
        methods = {"cold": local(rng.standard_normal(len(system.parameters)))}
        if options.run is not None:
            began = time.perf_counter()
            values = estimate(options.run, record, system)
            zero_shot = time.perf_counter() - began
            problem = Problem(simulator, record, occupancy="measured")
            methods["warm"] = local(problem.unknowns(values))
        methods |= {"evolution": evolution(index), "genetic": genetic(index)}
        methods = {name: method for name, method in methods.items() if name in options.methods}
        traces = {}
        for name, method in methods.items():
            # a plain misfit for all: no nuisance to integrate out, so that every method minimises the same
            counted = Counted(simulator)
            bare = Problem(simulator, record, occupancy="measured", history=False, runner=counted)
            bare.nuisance = bare.nuisance.only(np.zeros(bare.nuisance.size, dtype=bool))
            traces[name] = Trace(bare, counted, options.limit)
            with suppress(StopIteration):
                method(traces[name])
        target = min(trace.best for trace in traces.values()) * (1 + options.slack / 100)
        for name, trace in traces.items():
            found.setdefault(name, []).append(trace.reached(target))
        if options.run is not None:
            cost = Trace(bare, counted, 10**9).misfit(problem.unknowns(values))
            found.setdefault("zero-shot", []).append((0.0, zero_shot))
            found.setdefault("cold, as low as zero-shot", []).append(traces["cold"].reached(cost))
        said = "; ".join(f"{name} {rows[-1][0]:.0f} in {rows[-1][1]:.1f} s" for name, rows in found.items())
        print(f"system {index}: {said}", flush=True)
    print("\n| method | success | simulations (median) | seconds (median) |\n|---|---|---|---|")
    for name, rows in found.items():
        values_ = np.array(rows)
        good = np.isfinite(values_[:, 0])
        middle = np.median(values_, axis=0)
        print(f"| {name} | {good.mean():.0%} | {middle[0]:.0f} | {middle[1]:.1f} |")


if __name__ == "__main__":
    main()
