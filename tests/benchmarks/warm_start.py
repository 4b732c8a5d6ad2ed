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

Last, what simulation adds: R2 of each parameter over the rooms, of the estimator alone and of ``diagnosis calibrate``
started from it, which integrates out what happened within the hour and before the recording.

``--drawn``: in rooms whose uncertain constants are drawn. All methods then hold them at the description's values, which
are not theirs, but for ``diagnosis calibrate``, which fits them along.
"""

from __future__ import annotations

import argparse
import os
import shutil
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import xarray as xr
from intervals import noisy
from optimisers import Counted, Spent, Trace, evolution, genetic, local
from resumed import depends, resumed

from datagen import simulate
from datagen.driving.tables import merge
from datagen.simulating.simulator import Simulator
from diagnosis.calibrating.calibration import calibrate
from diagnosis.fitting.inputs import drive
from diagnosis.fitting.problem import WARM_UP, Problem
from diagnosis.recording import Recording, read_recording
from diagnosis.zero_shot import estimate
from shared.errors import SimulationError, ZeroshotError
from shared.metrics import r2
from shared.shipped import resolved_estimator
from shared.system import System, load_system
from trainer.intervals import r2_interval

LOCAL, GLOBAL = ("warm", "cold"), ("evolution", "genetic")
BATCH = 64
THOUSAND = 1000
"""How much faster than a cold start an estimate alone is meant to be."""


def by_fmpy(system: System, record: Recording, values: dict[str, float]) -> float:
    """Processor seconds of one ``fmpy.simulate_fmu`` over the warm-up and the recording, unpacked beforehand."""
    driven = drive(system, record, warm_up=WARM_UP)
    table = merge(driven.signals, driven.begin, driven.stop)
    edges = np.arange(driven.begin, driven.stop + 1, record.step)
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

    from trainer.predicting.recorded import read_window
    from trainer.runs.checkpoint import load_run

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
    data = simulate(system, seed=seed, index=index, uncertain=case["drawn"], out=path)
    values = {name: float(data[name]) for name in system.parameter_names}
    rng = np.random.default_rng([seed, index])
    record = noisy(read_recording(path, system), system, rng)

    def begin(limit: float = np.inf) -> Trace:
        # a plain misfit: no nuisance to integrate out, so that every method minimises the same
        counted = Counted(simulator)
        bare = Problem(simulator, record, occupancy="measured", known=["constants", "history"], runner=counted)
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
    try:
        done = calibrate(system, record, run=case["run"], starts=1)
        calibrated: dict[str, Any] = {"simulations": done.report.simulations, "seconds": done.report.seconds}
        calibrated |= {"values": {one.name: one.value for one in done.report.parameters}}
        calibrated["converged"] = done.report.converged
    except ZeroshotError as error:
        calibrated = {"error": str(error)}
    found = {
        "points": {name: trace.points for name, trace in traces.items()},
        "alone": alone,
        "truth": values,
        "zero-shot": answer,
        "calibrated": calibrated,
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


def speed(rows: Sequence[dict[str, Any]], half: float) -> None:
    """Print how fast each method was, and how much faster the estimator is."""
    fmpy_seconds = float(np.median([row["fmpy"] for row in rows]))
    print(
        f"; reached: the lowest misfit + {half:g}\n"
        f"one simulation: {np.median([row['native'] for row in rows]):.4f} s native, {fmpy_seconds:.3f} s by fmpy\n"
        "medians, and 10 and 90 % quantiles\n"
    )
    print(
        "| method | recordings | reached | simulations | seconds | as low a misfit as zero-shot: simulations, seconds"
        " | as small an error: simulations, seconds |\n|---|---|---|---|---|---|---|"
    )
    needed: dict[str, dict[int, tuple[float, float]]] = {}
    counts: dict[str, tuple[list[float], list[float]]] = {}
    for name in (*LOCAL, *GLOBAL):
        some = [(k, row) for k, row in enumerate(rows) if name in row["points"]]
        if not some:
            continue
        targets = [min(points[-1][2] for points in row["points"].values()) + half for _, row in some]
        got = [reached(row["points"][name], target) for (_, row), target in zip(some, targets, strict=True)]
        needed[name] = {k: one for (k, _), one in zip(some, got, strict=True)}
        lows = [reached(row["points"][name], row["alone"][0]) for _, row in some]
        errors = [reached(row["points"][name], row["alone"][1], 3) for _, row in some]
        counts[name] = ([one[0] for one in lows], [one[0] for one in errors])
        print(
            f"| {name} | {len(some)} | {sum(np.isfinite([one[0] for one in got]))} "
            f"| {middle([one[0] for one in got])} | {middle([one[1] for one in got], 2)} "
            f"| {middle([one[0] for one in lows])}, {middle([one[1] for one in lows], 2)} "
            f"| {middle([one[0] for one in errors])}, {middle([one[1] for one in errors], 2)} |"
        )
    warm, cold = (np.array([one[0] for one in needed[name].values()]) for name in LOCAL)
    both = np.isfinite(warm) & np.isfinite(cold)
    shares, rng = warm[both] / cold[both], np.random.default_rng(0)
    again = [rng.integers(len(shares), size=len(shares)) for _ in range(1000)]
    found = {
        "median": (np.median(shares), [np.median(shares[some]) for some in again]),
        "of the sums": (
            warm[both].sum() / cold[both].sum(),
            [warm[both][some].sum() / cold[both][some].sum() for some in again],
        ),
    }
    print(f"\nwarm / cold simulations where both reached ({both.sum()} recordings), and 90 % intervals by recording:")
    for name, (value, values) in found.items():
        low, high = np.quantile(values, [0.05, 0.95])
        print(f"{name} {value:.2f} [{low:.2f}, {high:.2f}]")
    print(f"at most a third in {np.sum(shares <= 1 / 3)}")
    single, batched = np.median([row["forward"] for row in rows], axis=0)
    print(f"zero-shot forward pass: {1000 * single:.1f} ms alone, {1000 * batched:.2f} ms in a batch of {BATCH}")
    print("\n| as good as zero-shot | by | misfit: recordings, seconds, times a pass alone | error: the same |")
    print("|---|---|---|---|")
    cold_seconds = [
        [reached(row["points"]["cold"], row["alone"][what - 2], what)[1] for row in rows] for what in (2, 3)
    ]
    table = [("our cold start", "our simulations", cold_seconds)]
    for name, some in counts.items():
        if name != "warm":
            table.append((name, "fmpy", [[fmpy_seconds * one for one in each] for each in some]))
    for name, simulator, seconds in table:
        cells = []
        for some in seconds:
            half = float(np.quantile(some, 0.5, method="higher"))
            said = f"{sum(np.isfinite(some))} of {len(some)}, {half:.2f}, {half / single:.0f}"
            cells.append(said.replace("inf", "not"))
        print(f"| {name} | {simulator} | {' | '.join(cells)} |")
    times = np.array([one * row["fmpy"] / row["forward"][0] for one, row in zip(counts["cold"][0], rows, strict=True)])
    print(
        f"cold by fmpy, room by room: {np.sum(times >= THOUSAND)} of {len(times)} at least {THOUSAND} passes,"
        f" least {times.min():.0f}"
    )


def accuracy(rows: Sequence[dict[str, Any]]) -> None:
    """Print R2 of each parameter over the rooms, of the estimator alone and calibrated from there."""
    some = [row for row in rows if "values" in row["calibrated"]]
    names = list(some[0]["truth"])
    truth, alone, fitted = (
        np.array([[row[name] for name in names] for row in table])
        for table in (
            [row["truth"] for row in some], [row["zero-shot"] for row in some],
            [row["calibrated"]["values"] for row in some],
        )
    )  # fmt: skip
    spent = [row["calibrated"] for row in some]
    print(
        f"\ncalibrated: {len(some)} of {len(rows)}, of these converged {sum(one['converged'] for one in spent)};"
        f" {middle([one['simulations'] for one in spent])} simulations\n"
        "R2 over the rooms, and its 90 % interval by room; of calibrated / true the mean logarithm, its standard error,"
        " and in how many rooms it is below\n\n| parameter | zero-shot | calibrated | logarithm | below |\n"
        "|---|---|---|---|---|"
    )
    apart = np.log(fitted / truth)
    bias = [
        f"{one.mean():.3f} ({one.std(ddof=1) / np.sqrt(len(one)):.3f}) | {np.sum(one < 0)} of {len(one)}"
        for one in apart.T
    ]

    def scores(rows: np.ndarray) -> np.ndarray:
        both = [r2(truth[rows], estimate[rows]) for estimate in (alone, fitted)]
        return np.array([[*one, one.mean()] for one in both])

    found = scores(np.arange(len(some)))
    low, high = r2_interval(np.arange(len(some)), scores)
    for k, (name, shift) in enumerate(zip([*names, "mean"], [*bias, " | "], strict=True)):
        columns = [f"{found[m, k]:.2f} [{low[m, k]:.2f}, {high[m, k]:.2f}]" for m in range(2)]
        print(f"| {name} | {' | '.join(columns)} | {shift} |")


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
    parser.add_argument("--drawn", action="store_true", help="rooms with uncertain constants drawn")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("warm-start"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    common = {
        "system": str(options.system), "run": str(options.run), "folder": str(options.out), "hours": options.hours,
        "seed": options.seed, "limit": options.limit, "restarts": options.restarts, "drawn": options.drawn,
    }  # fmt: skip
    cases = [{**common, "index": k, "global": k < options.global_systems} for k in range(options.systems)]
    of = depends(options.system, run=options.run)
    rows = resumed(options.out / "cases.jsonl", cases, made, of=of, workers=options.workers)
    print(f"\n{options.systems} recordings of {options.hours:g} h, root seed {options.seed}", end="")
    speed(rows, 0.5 * len(load_system(options.system).parameters))
    accuracy(rows)


if __name__ == "__main__":
    main()
