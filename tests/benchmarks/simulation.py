"""One simulated year: the native integrator beside ``fmpy.simulate_fmu``, in turn, on the same inputs.

fmpy freezes its inputs over each output step, so both get inputs that are constant over each hour, given to fmpy as
double knots: then it is exact, and the two must agree. Then the farm's own inputs: time and accuracy, and how much of
the time the FMU's own functions take, called as often, one after another, with nothing around them. Last, where the
time of the simulations of a fit goes. Times are of the processor, not of the clock, so that others on the machine
disturb them less.

Run: ``python tests/benchmarks/simulation.py [--days 365]``.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from unittest import mock

import fmpy
import numpy as np
from numba import njit

from datagen import simulate
from datagen.driving.inputs import build_inputs
from datagen.driving.sampling import sample_parameters
from datagen.driving.tables import Piecewise, merge
from datagen.fmi import instances
from datagen.fmi.foreign import foreign
from datagen.simulating import native
from datagen.simulating.simulator import Simulator
from datagen.simulating.solver import Cvode
from diagnosis import calibrate
from diagnosis.fitting import simulations
from diagnosis.fitting.runs import Runs
from diagnosis.fitting.simulations import Warmed
from shared.system import load_system

HERE = Path(__file__).resolve().parents[2]


_set_time = foreign("i:pd")
_pass = foreign("i:pppp")
_exchange = foreign("i:ppp")


@njit(error_model="numpy")
def evaluate(functions, component, count, states, inputs, input_references, output_references, derivatives):
    """Call the FMU's functions ``count`` times as an evaluation of derivatives, or of indicators, calls them."""
    set_time, set_real, set_states, get, get_real = functions
    out = np.empty(256)
    for k in range(count):
        row = k % len(states)
        _set_time(set_time, component, 3600.0 * row)
        _pass(set_real, component, input_references.ctypes.data, inputs.shape[1], inputs[row].ctypes.data)
        _exchange(set_states, component, states[row].ctypes.data, states.shape[1])
        _exchange(get, component, out.ctypes.data, derivatives)
        if derivatives == states.shape[1]:
            _pass(get_real, component, output_references.ctypes.data, len(output_references), out.ctypes.data)


def seconds_inside(simulator, values, table, stop, counts):
    """Time of the FMU's own functions alone [s], evaluated as often as in a simulation, at states it went through."""
    system, fmu = simulator.system, simulator.fmu
    states = simulator.run(values, table, start=0.0, stop=stop, record_states=True).states[:-1]
    inputs = np.ascontiguousarray(table.means(np.arange(0.0, stop + 1, 3600.0)))
    references = [fmu.variables[name].valueReference for name in system.input_names]
    means = [fmu.variables[o.fmu_variable].valueReference for o in system.outputs if o.method == "mean"]
    found = 0.0
    for name, size, calls in (
        ("fmi2GetDerivatives", fmu.n_states, counts["right_hand_sides"]),
        ("fmi2GetEventIndicators", fmu.n_indicators, counts["indicator_calls"]),
    ):
        names = ("fmi2SetTime", "fmi2SetReal", "fmi2SetContinuousStates", name, "fmi2GetReal")
        functions = tuple(fmu.interface.address(one) for one in names)
        arrays = (states, inputs, np.array(references, dtype=np.uint32), np.array(means, dtype=np.uint32), size)
        evaluate(functions, fmu.interface.instance, 10, *arrays)
        began = time.process_time()
        evaluate(functions, fmu.interface.instance, calls, *arrays)
        found += time.process_time() - began
    return found


def fit() -> None:
    """Where the time of the simulations of a calibration goes: a week by the hour, one start."""
    times: dict[str, list[float]] = {}

    def timed(owner, name, label):
        function = getattr(owner, name)

        def wrapped(*arguments, **settings):
            began = time.process_time()
            try:
                return function(*arguments, **settings)
            finally:
                times.setdefault(label, []).append(time.process_time() - began)

        return mock.patch.object(owner, name, wrapped)

    parts = (
        (Runs, "run", "its inputs and parameters"),
        (simulations, "key_of", "its key"),
        (Warmed, "outputs", "the simulation, with its warm-up where that is new"),
        (Simulator, "run", "in that: the warm-up and the recording"),
        (instances, "initialise", "in that: making and initialising an instance"),
        (Cvode, "__init__", "in that: setting up CVODE"),
        (native, "drive", "in that: integrating"),
    )
    with tempfile.TemporaryDirectory() as folder, ExitStack() as patches:
        path = Path(folder) / "week.nc"
        simulate("MixedAirCO2", out=path, hours=168, seed=99)
        for part in parts:
            patches.enter_context(timed(*part))
        began = time.process_time()
        calibrate("MixedAirCO2", path, starts=1)
        whole = time.process_time() - began
    count = len(times[parts[2][2]])
    print(f"\nA calibration of a week takes {whole:.1f} s for {count} simulations. Of each [ms]:\n")
    for _, _, label in parts:
        print(f"{label}: {1e3 * sum(times[label]) / count:.2f} ({len(times[label]) / count:.2f} calls)")


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
    seconds: dict[str, list[float]] = {name: [] for name in ("native", "fmpy", "farm", "inside")}
    errors: dict[str, list[np.ndarray]] = {"native": [], "fmpy": [], "farm": []}
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
        began = time.process_time()
        ours = simulator.run(values, table, start=0.0, stop=stop).outputs[rows]
        seconds["native"].append(time.process_time() - began)
        began = time.process_time()
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
        seconds["fmpy"].append(time.process_time() - began)
        assert len(record) == len(edges), "fmpy returned short data"
        theirs = np.stack([record[o.fmu_variable][1:] for o in points])
        began = time.process_time()
        farm = simulator.run(values, real, start=0.0, stop=stop)
        seconds["farm"].append(time.process_time() - began)
        counts = farm.statistics
        seconds["inside"].append(seconds_inside(simulator, values, real, stop, counts))
        tight = simulator.run(values, real, start=0.0, stop=stop, tolerance=1e-9)
        errors["farm"].append(np.abs(farm.outputs - tight.outputs))
        reference = simulator.run(values, table, start=0.0, stop=stop, tolerance=1e-9).outputs[rows]
        errors["native"].append(np.abs(ours - reference))
        errors["fmpy"].append(np.abs(theirs - reference))
    ratio = statistics.median(f / n for f, n in zip(seconds["fmpy"], seconds["native"], strict=True))
    print(
        f"{options.days} days, {options.rounds} systems, tolerance {system.experiment.tolerance:g}; errors are against"
    )
    print("the native integrator at 1e-9\n")
    print(f"| what | median processor time [s] | {heads_of(points)} |")
    print("|---|---|" + "---|---|" * len(points))
    for name, label in (("native", "native integrator"), ("fmpy", "fmpy.simulate_fmu, same inputs as double knots")):
        cells = cells_of(np.concatenate(errors[name], axis=1))
        print(f"| {label} | {statistics.median(seconds[name]):.3f} | {cells} |")
    print(f"\nratio fmpy / native: {ratio:.1f}")
    share = statistics.median(f / i for f, i in zip(seconds["farm"], seconds["inside"], strict=True))
    print("\nThe farm's own inputs (lines and jumps within the hour):\n")
    print(f"| processor time [s] | in the FMU's own functions [s] | ratio | {heads_of(system.outputs)} |")
    print("|---|---|---|" + "---|---|" * len(system.outputs))
    cells = cells_of(np.concatenate(errors["farm"], axis=1))
    farm_seconds, inside = statistics.median(seconds["farm"]), statistics.median(seconds["inside"])
    print(f"| {farm_seconds:.3f} | {inside:.3f} | {share:.2f} | {cells} |\n\n{counts}")
    fit()
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


def heads_of(outputs):
    return " | ".join(f"{o.name} rms [{o.unit}] | {o.name} largest" for o in outputs)


def cells_of(errors):
    return " | ".join(f"{np.sqrt(np.mean(e**2)):.2g} | {e.max():.2g}" for e in errors)


if __name__ == "__main__":
    main()
