"""One simulated year: the native integrator beside ``fmpy.simulate_fmu``, in turn, on the same inputs.

fmpy freezes its inputs over each output step, so both get inputs that are constant over each hour, given to fmpy as
double knots: then it is exact, and the two must agree. Run: ``python tests/benchmarks/simulation.py [--days 365]``.
"""

from __future__ import annotations

import argparse
import statistics
import time
from pathlib import Path

import fmpy
import numpy as np

from datagen.inputs import build_inputs
from datagen.sampling import sample_parameters
from datagen.simulator import Simulator
from datagen.tables import Piecewise, merge
from shared.system import load_system

HERE = Path(__file__).resolve().parents[2]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--days", type=int, default=365)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    system = load_system(HERE / "fmus" / "MixedAirCO2" / "system.toml")
    simulator = Simulator(system)
    stop = options.days * 86400.0
    points = [o for o in system.outputs if o.method == "point"]
    rows = [system.output_names.index(o.name) for o in points]
    edges = np.arange(0.0, stop + 1, 3600.0)
    seconds: dict[str, list[float]] = {name: [] for name in ("native", "fmpy", "farm")}
    errors: dict[str, list[np.ndarray]] = {"native": [], "fmpy": []}
    for index in range(options.rounds):
        real = build_inputs(system, root_seed=7, index=index, start=0.0, stop=stop)
        means = real.means(edges)
        held = {n: Piecewise(edges[:-1], means[:, k], "previous") for k, n in enumerate(system.input_names)}
        table = merge(held, 0.0, stop)
        double = np.zeros(2 * len(means), dtype=[("time", "f8"), *((n, "f8") for n in system.input_names)])
        double["time"] = np.repeat(edges, 2)[1:-1]
        for k, name in enumerate(system.input_names):
            double[name] = np.repeat(means[:, k], 2)
        values = dict(zip(system.parameter_names, sample_parameters(system, 7, index).tolist(), strict=True))
        if index == 0:  # compile before anything is timed
            simulator.run(values, table, start=0.0, stop=7200.0)
        began = time.perf_counter()
        ours = simulator.run(values, table, start=0.0, stop=stop).outputs[rows]
        seconds["native"].append(time.perf_counter() - began)
        began = time.perf_counter()
        record = fmpy.simulate_fmu(
            str(system.fmu_path),
            stop_time=stop,
            start_values={**system.fixed, **values},
            input=double,
            output=[o.fmu_variable for o in points],
            output_interval=3600.0,
            relative_tolerance=system.experiment.tolerance,
            record_events=False,
        )
        seconds["fmpy"].append(time.perf_counter() - began)
        assert len(record) == len(edges), "fmpy returned short data"
        theirs = np.stack([record[o.fmu_variable][1:] for o in points])
        began = time.perf_counter()
        counts = simulator.run(values, real, start=0.0, stop=stop).statistics
        seconds["farm"].append(time.perf_counter() - began)
        reference = simulator.run(values, table, start=0.0, stop=stop, tolerance=1e-9).outputs[rows]
        errors["native"].append(np.abs(ours - reference))
        errors["fmpy"].append(np.abs(theirs - reference))
    ratio = statistics.median(f / n for f, n in zip(seconds["fmpy"], seconds["native"], strict=True))
    print(
        f"{options.days} days, {options.rounds} systems, tolerance {system.experiment.tolerance:g}; errors are against"
    )
    print("the native integrator at 1e-9\n")
    heads = " | ".join(f"{o.name} rms [{o.unit}] | {o.name} largest" for o in points)
    print(f"| what | median time per core [s] | {heads} |")
    print("|---|---|" + "---|---|" * len(points))
    for name, label in (("native", "native integrator"), ("fmpy", "fmpy.simulate_fmu, same inputs as double knots")):
        all_errors = np.concatenate(errors[name], axis=1)
        cells = " | ".join(f"{np.sqrt(np.mean(e**2)):.2g} | {e.max():.2g}" for e in all_errors)
        print(f"| {label} | {statistics.median(seconds[name]):.3f} | {cells} |")
    print(f"\nratio fmpy / native: {ratio:.1f}")
    print(
        f"the farm's own inputs (lines and jumps within the hour): {statistics.median(seconds['farm']):.3f} s, {counts}"
    )


if __name__ == "__main__":
    main()
