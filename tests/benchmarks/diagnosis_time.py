"""What one diagnosis takes: four weeks of hourly data, with fifteen candidates and with all of the library.

    python tests/benchmarks/diagnosis_time.py fmus/MixedAirCO2 --seed SEED --out diagnosis-time

``--persons unknown`` and ``--replay`` time the same recording with persons that nobody counted, and with its recorded
actuators in place of the control loops.

The recording is a random room with air that leaks through its envelope, seen through its sensors. Printed for each
number of candidates: wall time, processor time of all processes, simulations, and the verdict; and beside it the load
of the machine, because wall time on a busy machine says little. Both diagnoses are in processes of their own, as
``diagnosis run`` would be, start and report included.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from datagen import simulate
from diagnosis.effects import library
from shared.system import load_system

FIFTEEN = 15
GAP = {"effect.infiltration.cStack": 0.004}
WEEKS = 672.0


def recording(system_path: str, path: Path, seed: int, hours: float) -> None:
    """A recording of a leaking room, with the sensors' noise, rounding and lost readings."""
    system = load_system(system_path)
    data = simulate(system, parameters=GAP, hours=hours, seed=seed)
    rng = np.random.default_rng(seed)
    for output in system.outputs:
        values, sensor = data[output.name].values, output.noise["sensor"]
        values[:] = values + sensor.sd * rng.standard_normal(values.shape)
        if sensor.quantum:
            values[:] = np.round(values / sensor.quantum) * sensor.quantum
        values[rng.random(values.shape) < sensor.dropout] = np.nan
    data.to_netcdf(path)


def diagnosed(
    system_path: str, path: Path, count: int, workers: int, out: Path, persons: str, replay: bool
) -> dict[str, object]:
    """One diagnosis with the first ``count`` candidates of every kind in turn: what it took and said."""
    from diagnosis.gap.diagnosed import diagnose

    system = load_system(system_path)
    kinds: dict[str, list[object]] = {}
    for one in library(system):
        kinds.setdefault(one.kind, []).append(one)
    turns = [row[k] for k in range(max(map(len, kinds.values()))) for row in kinds.values() if k < len(row)]
    chosen = [one for one in library(system) if one in turns[:count]]
    conditions = {"occupancy": persons, "replay": replay}
    report = diagnose(system, path, effects=chosen, workers=workers, out=out, **conditions).report
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return {
        "candidates": len(chosen),
        "cpu": sum(one.ru_utime + one.ru_stime for one in (own, children)),
        "simulations": report.simulations,
        "verdict": report.verdict,
        "load": os.getloadavg()[0],
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hours", type=float, default=WEEKS)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--persons", choices=["measured", "unknown"], default="measured")
    parser.add_argument("--replay", action="store_true")
    parser.add_argument("--candidates", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    path = options.out / "recording.nc"
    if options.candidates is not None:
        folder = options.out / f"report-{options.candidates}"
        conditions = options.persons, options.replay
        row = diagnosed(options.system, path, options.candidates, options.workers, folder, *conditions)
        print(json.dumps(row))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    recording(options.system, path, options.seed, options.hours)
    print(
        f"{options.hours / 168:g} weeks, {options.workers} workers, {os.cpu_count()} cores, persons {options.persons}"
        + (", replay" if options.replay else "")
    )
    print("| candidates | wall [s] | processor time [s] | simulations | verdict | load average |")
    print("|---:|---:|---:|---:|---|---:|")
    for count in (FIFTEEN, len(library(load_system(options.system)))):
        words = [sys.executable, __file__, *sys.argv[1:], "--candidates", str(count)]
        began = time.perf_counter()  # the start of the program is part of it
        done = subprocess.run(words, check=True, capture_output=True, text=True)
        wall = time.perf_counter() - began
        row = json.loads(done.stdout.strip().splitlines()[-1])
        print(
            f"| {row['candidates']} | {wall:.0f} | {row['cpu']:.0f} | {row['simulations']} | {row['verdict']} "
            f"| {row['load']:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
