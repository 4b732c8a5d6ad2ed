"""Warm against cold start: simulations and seconds until the same misfit, beside global optimisers as the field uses.

    python tests/benchmarks/warm_start.py fmus/MixedAirCO2 --run MixedAirCO2 --systems 50 --global-systems 10

All methods minimise the same: half the squares of the residuals by the sensors' noise and of the prior, persons as
they were counted, over a week of a room never seen. **Reached** is the lowest misfit that any method found, plus half
the number of parameters, which is how far a draw from the posterior lies above it. ``warm`` begins at the estimator's
answer, ``cold`` at a draw from the prior, both by this package's fit; where that ends elsewhere it begins again at a
draw from the prior, ``--restarts`` times. ``evolution`` is differential evolution with scipy's defaults in the unit
cube of the parameters' ranges, ``genetic`` a genetic algorithm (tournaments, blend crossover, Gaussian mutation, one
elite), both on the first ``--global-systems`` recordings and for ``--limit`` simulations at most; what was not reached
counts as more than all that was.

``zero-shot`` is the estimator alone: the seconds of its forward pass, and what the others need until their misfit, or
their error in the parameters, is as low as its own. Seconds are of the processor. One simulation of the week by
``fmpy.simulate_fmu`` is measured beside each recording, since that is what the field's optimisers call.
"""

from __future__ import annotations

import argparse
import os
import shutil
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import xarray as xr
from intervals import noisy
from resumed import resumed
from scipy.optimize import differential_evolution
from scipy.special import ndtr, ndtri

from datagen import simulate
from datagen.simulator import Simulator
from diagnosis.calibrating.calibration import estimate
from diagnosis.fitting.fit import fit
from diagnosis.fitting.problem import LIMIT, WARM_UP, Problem
from diagnosis.fitting.side_by_side import InProcess, Outcome, Run
from diagnosis.recording import Recording, read_recording, recorded_inputs
from shared.errors import SimulationError
from shared.shipped import resolved_estimator
from shared.system import System, load_system

LOCAL, GLOBAL = ("warm", "cold"), ("evolution", "genetic")
BATCH = 64


class Spent(Exception):
    """A method has used up its simulations."""


class Counted(InProcess):
    """Simulations in this process, and how many there were."""

    count = 0

    def map(self, runs: Sequence[Run]) -> list[Outcome]:
        """See :class:`diagnosis.fitting.side_by_side.Runner`."""
        self.count += len(runs)
        return super().map(runs)


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
    problem = trace.problem
    plain, trace.began = problem.residuals, time.process_time() - trace.spent

    def watched(z: np.ndarray, around: object = None) -> np.ndarray:
        made = plain(z, around)  # type: ignore[arg-type]
        trace.note(z, 0.5 * float(made @ made + z @ z))
        return made

    problem.residuals = watched  # type: ignore[method-assign]
    with suppress(SimulationError):
        fit(problem, [start])
    problem.residuals = plain  # type: ignore[method-assign]
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


def by_fmpy(system: System, record: Recording, values: dict[str, float]) -> float:
    """Processor seconds of one ``fmpy.simulate_fmu`` over the warm-up and the recording, unpacked beforehand."""
    table = recorded_inputs(system, record, WARM_UP)
    edges = np.arange(record.start - WARM_UP, record.stop + 1, record.step)
    means = table.means(edges)
    double = np.zeros(2 * len(means), dtype=[("time", "f8"), *((name, "f8") for name in system.input_names)])
    double["time"] = np.repeat(edges, 2)[1:-1]
    for k, name in enumerate(system.input_names):
        double[name] = np.repeat(means[:, k], 2)
    folder = fmpy.extract(str(system.fmu_path))
    began = time.process_time()
    made = fmpy.simulate_fmu(
        folder, start_time=edges[0], stop_time=edges[-1], start_values={**system.fixed, **values}, input=double,
        output=[one.fmu_variable for one in system.outputs], output_interval=record.step,
        relative_tolerance=system.experiment.tolerance, record_events=False,
    )  # fmt: skip
    spent = time.process_time() - began
    shutil.rmtree(folder)
    if len(made) != len(edges):
        raise SimulationError("fmpy returned short data")
    return spent


def forward(run: Path, path: Path) -> tuple[float, float]:
    """Processor seconds of the estimator's forward pass for one recording: alone, and in a batch."""
    import torch

    from trainer.checkpoint import load_run
    from trainer.prediction import read_window

    torch.set_num_threads(1)
    estimator = load_run(run)
    window = read_window(path, estimator.card.encoding)
    begins = window.begins + window.stamps[0]
    spent = []
    for size in (1, BATCH):
        values, times = np.repeat(window.values, size, axis=0), np.repeat(begins, size)
        estimator.estimate(values, times)  # the first one warms up
        tries = []
        for _ in range(5):
            began = time.process_time()
            estimator.estimate(values, times)
            tries.append((time.process_time() - began) / size)
        spent.append(float(np.median(tries)))
    return spent[0], spent[1]


def made(case: dict[str, Any]) -> dict[str, Any]:
    """All methods on one recording."""
    hours, seed, index = case["hours"], case["seed"], case["index"]
    system = load_system(case["system"]).with_experiment(hours=hours, start=(0.0, 8760.0 - hours))
    simulator = Simulator(system)
    path = Path(case["folder"]) / f"system-{seed}-{index}.nc"
    data = simulate(system, seed=seed, index=index, out=path)
    values = {name: float(data[name]) for name in system.parameter_names}
    rng = np.random.default_rng([seed, index])
    record = noisy(read_recording(path, system), system, rng)

    def begin(limit: float = np.inf) -> Trace:
        # a plain misfit: no nuisance to integrate out, so that every method minimises the same
        counted = Counted(simulator)
        bare = Problem(simulator, record, occupancy="measured", history=False, runner=counted)
        bare.nuisance = bare.nuisance.only(np.zeros(bare.nuisance.size, dtype=bool))
        return Trace(bare, counted, bare.unknowns(values), limit)

    answer = estimate(case["run"], record, system)
    bare = begin()
    guess = bare.problem.unknowns(answer)
    alone = (bare.misfit(guess), float(np.sqrt(np.mean((guess - bare.truth) ** 2))))
    traces = {"warm": begin(), "cold": begin()}
    starts = {"warm": [guess], "cold": []}
    for again in range(1 + case["restarts"]):
        for name, trace in traces.items():
            lowest = min(one.best for one in traces.values())
            if again and trace.best <= lowest + 0.5 * trace.problem.size:
                continue
            local(trace, starts[name].pop() if starts[name] else rng.standard_normal(trace.problem.size))
    for name, method in (("evolution", evolution), ("genetic", genetic)):
        if case["global"]:
            traces[name] = begin(case["limit"])
            with suppress(Spent):
                method(traces[name], index)
    noisy_path = path.with_name(f"noisy-{path.name}")
    shown = xr.load_dataset(path, decode_times=False)
    for name, row in zip(system.output_names, record.outputs, strict=True):
        shown[name].values[:] = np.where(np.isfinite(row), row, np.nanmean(row))
    shown.to_netcdf(noisy_path)
    single, batched = forward(resolved_estimator(Path(case["run"])), noisy_path)
    found = {
        "points": {name: trace.points for name, trace in traces.items()},
        "alone": alone,
        "forward": [single, batched],
        "fmpy": by_fmpy(system, record, values),
        "native": bare.points[0][1],
        "load": os.getloadavg()[0],
    }
    path.unlink()
    noisy_path.unlink()
    return found


def reached(points: Sequence[Sequence[float]], target: float, what: int = 2) -> tuple[float, float]:
    """Simulations and seconds until a misfit (2) or an error (3) is as low as a target; infinite if never."""
    return next(((one[0], one[1]) for one in points if one[what] <= target), (np.inf, np.inf))


def middle(values: Sequence[float], digits: int = 0) -> str:
    """Median, and the 10 and 90 % quantiles, of numbers some of which may be infinite."""
    # the order of what was reached and what was not is enough: no interpolation between numbers
    low, half, high = np.quantile(np.array(values, dtype=float), [0.1, 0.5, 0.9], method="higher")
    return f"{half:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]".replace("inf", "not")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system", type=Path)
    parser.add_argument("--run", type=Path, required=True)
    parser.add_argument("--systems", type=int, default=50)
    parser.add_argument("--global-systems", type=int, default=10)
    parser.add_argument("--hours", type=float, default=168.0)
    parser.add_argument("--seed", type=int, default=9200, help="root seed; take one that no estimator was trained on")
    parser.add_argument("--limit", type=int, default=2000, help="simulations that a global method may spend")
    parser.add_argument("--restarts", type=int, default=4)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("warm-start"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    common = {
        "system": str(options.system), "run": str(options.run), "folder": str(options.out), "hours": options.hours,
        "seed": options.seed, "limit": options.limit, "restarts": options.restarts,
    }  # fmt: skip
    cases = [{**common, "index": k, "global": k < options.global_systems} for k in range(options.systems)]
    rows = resumed(options.out / "cases.jsonl", cases, made, workers=options.workers)
    half = 0.5 * len(load_system(options.system).parameters)
    fmpy_seconds = float(np.median([row["fmpy"] for row in rows]))
    print(
        f"\n{options.systems} recordings of {options.hours:g} h, root seed {options.seed};"
        f" reached: the lowest misfit + {half:g}\n"
        f"one simulation: {np.median([row['native'] for row in rows]):.4f} s native, {fmpy_seconds:.3f} s by fmpy\n"
        "medians, and 10 and 90 % quantiles\n"
    )
    print(
        "| method | recordings | reached | simulations | seconds | as low a misfit as zero-shot: simulations, seconds"
        " | as small an error: simulations, seconds |\n|---|---|---|---|---|---|---|"
    )
    needed: dict[str, dict[int, tuple[float, float]]] = {}
    as_low: dict[str, list[float]] = {}
    for name in (*LOCAL, *GLOBAL):
        some = [(k, row) for k, row in enumerate(rows) if name in row["points"]]
        if not some:
            continue
        targets = [min(points[-1][2] for points in row["points"].values()) + half for _, row in some]
        got = [reached(row["points"][name], target) for (_, row), target in zip(some, targets, strict=True)]
        needed[name] = {k: one for (k, _), one in zip(some, got, strict=True)}
        lows = [reached(row["points"][name], row["alone"][0]) for _, row in some]
        errors = [reached(row["points"][name], row["alone"][1], 3) for _, row in some]
        as_low[name] = [one[0] for one in lows]
        print(
            f"| {name} | {len(some)} | {np.mean(np.isfinite([one[0] for one in got])):.0%} "
            f"| {middle([one[0] for one in got])} | {middle([one[1] for one in got], 2)} "
            f"| {middle([one[0] for one in lows])}, {middle([one[1] for one in lows], 2)} "
            f"| {middle([one[0] for one in errors])}, {middle([one[1] for one in errors], 2)} |"
        )
    shares = [needed["warm"][k][0] / needed["cold"][k][0] for k in needed["warm"] if np.isfinite(needed["cold"][k][0])]
    sums = [np.array([one[0] for one in needed[name].values()]) for name in LOCAL]
    both = np.isfinite(sums[0]) & np.isfinite(sums[1])
    print(
        f"\nwarm / cold simulations, recording by recording: {middle(shares, 2)}; of the sums where both reached:"
        f" {sums[0][both].sum() / sums[1][both].sum():.2f}"
    )
    single, batched = np.median([row["forward"] for row in rows], axis=0)
    print(f"zero-shot forward pass: {1000 * single:.1f} ms alone, {1000 * batched:.2f} ms in a batch of {BATCH}")
    print("\n| until as low a misfit as zero-shot | by | seconds | times a pass alone | times a pass in a batch |")
    print("|---|---|---|---|---|")
    native = [reached(row["points"]["cold"], row["alone"][0])[1] for row in rows]
    table = [("our cold start", "our simulations", float(np.quantile(native, 0.5, method="higher")))]
    for name, counts in as_low.items():
        if name != "warm":
            table.append((name, "fmpy", fmpy_seconds * float(np.quantile(counts, 0.5, method="higher"))))
    for name, simulator, seconds in table:
        print(f"| {name} | {simulator} | {seconds:.2f} | {seconds / single:.0f} | {seconds / batched:.0f} |")


if __name__ == "__main__":
    main()
