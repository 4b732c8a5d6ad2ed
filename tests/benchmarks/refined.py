"""What simulation adds where nobody counted the persons: R2 of the zero-shot estimate and of a calibration from there.

    python tests/benchmarks/refined.py fmus/MixedAirCO2 --run MixedAirCO2 --systems 50 --seed SEED --out refined

Random rooms over a week from anywhere in the year, as ``trainer evaluate`` scores them: with or without the sensors'
noise, with all outputs or without those of ``--without``. From each window ``trainer predict`` estimates, and
``diagnosis calibrate --starts 1`` goes on from there with persons unknown, and finds the noise as it does by default:
told that there is none, a fit makes parameters of persons who came within the half hours that it knows of. Printed for
each condition and parameter: R2 over the rooms of both and of their mean, with 90 % intervals by room, and how alike
their errors are: where two unlike methods err in the same rooms in the same way, it is the data that do not tell.
Beside them belongs the limit of ``datagen identifiability`` (docs/results.md). The command also fits the uncertain
constants of the description, which these rooms have as declared. Take a seed that nothing was developed on.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from intervals import noisy
from resampling import bootstrap_by_system
from resumed import depends, resumed

from datagen import simulate
from diagnosis.calibrating.calibration import calibrate
from diagnosis.recording import read_recording
from diagnosis.usual import HALF_WIDTH
from shared.errors import ZeroshotError
from shared.metrics import r2
from shared.system import load_system
from trainer.intervals import r2_interval


def made(case: dict[str, Any]) -> dict[str, Any]:
    """One room under one condition: the truth, the estimate, the calibration."""
    hours, seed, index = case["hours"], case["seed"], case["index"]
    system = load_system(case["system"]).with_experiment(hours=hours, start=(0.0, 8760.0 - hours))
    path = Path(case["folder"]) / f"room-{seed}-{index}-{case['noise']}-{len(case['without'])}.nc"
    data = simulate(system, seed=seed, index=index, out=path)
    record = read_recording(path, system)
    if case["noise"] != "none":
        record = noisy(record, system, np.random.default_rng([seed, index]), case["noise"])
    shown = record.outputs.copy()
    shown[[system.output_names.index(name) for name in case["without"]]] = np.nan
    record = replace(record, outputs=shown)
    truth = {name: float(data[name]) for name in system.parameter_names}
    began = time.process_time()
    try:
        done = calibrate(system, record, run=case["run"], occupancy="unknown", noise="sensor", starts=1)
        spent = time.process_time() - began
        told = {one.name: one for one in done.report.parameters}
    except ZeroshotError as error:
        return {"error": str(error)}
    finally:
        path.unlink()
    count = len(truth)
    off = done.fit.z[:count] - done.problem.unknowns(truth)[:count]
    return {
        "truth": truth,
        "zero-shot": {name: told[name].zero_shot for name in truth},
        "calibrated": {name: told[name].value for name in truth},
        "error": None,
        "off": (off / np.sqrt(np.diag(done.report.covariance))[:count]).tolist(),
        "converged": done.report.converged,
        "simulations": done.report.simulations,
        "seconds": spent,
    }


def table(rows: list[dict[str, Any]], title: str) -> None:
    """Print R2 of both by parameter."""
    some = [row for row in rows if row["error"] is None]
    if len(some) < 2:
        print(f"\n{title}: {len(some)} of {len(rows)} could be calibrated")
        return
    names = list(some[0]["truth"])
    truth, alone, refined = (
        np.array([[row[key][name] for name in names] for row in some]) for key in ("truth", "zero-shot", "calibrated")
    )

    def scores(which: np.ndarray) -> np.ndarray:
        each = [r2(truth[which], one[which]) for one in (alone, refined, 0.5 * (alone + refined))]
        return np.array([[*one, one.mean()] for one in [*each, each[1] - each[0]]])

    found = scores(np.arange(len(some)))
    low, high = r2_interval(np.arange(len(some)), scores)
    # a difference of R2 is not biased as R2 is
    low[3], high[3] = (ends[3] for ends in bootstrap_by_system(np.arange(len(some)), scores))
    off = np.abs([row["off"] for row in some])
    held = [*(off < HALF_WIDTH).mean(axis=0), float((off < HALF_WIDTH).mean())]
    print(
        f"\n{title}: {len(some)} of {len(rows)} calibrated, {sum(row['converged'] for row in some)} came to rest;"
        f" median {np.median([row['simulations'] for row in some]):.0f} simulations,"
        f" {np.median([row['seconds'] for row in some]):.0f} s\n\n"
        "| parameter | zero-shot | calibrated | mean of both | gained by calibrating | correlation of the errors "
        f"| 90 % intervals that hold |\n|{'---|' * 7}"
    )
    alike = [np.corrcoef(alone[:, k] - truth[:, k], refined[:, k] - truth[:, k])[0, 1] for k in range(len(names))]
    for k, name in enumerate([*names, "mean"]):
        cells = [f"{found[m, k]:.2f} [{low[m, k]:.2f}, {high[m, k]:.2f}]" for m in range(4)]
        print(f"| {name} | {' | '.join(cells)} | {[*alike, np.mean(alike)][k]:.2f} | {100 * held[k]:.0f}% |")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system", type=Path)
    parser.add_argument("--run", type=Path, required=True)
    parser.add_argument("--systems", type=int, default=50)
    parser.add_argument("--hours", type=float, default=168.0)
    parser.add_argument("--seed", type=int, required=True, help="root seed; take one that nothing was developed on")
    parser.add_argument("--noise", nargs="+", default=["sensor", "none"])
    parser.add_argument("--without", nargs="*", default=[], help="outputs that were not measured, for a second set")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("refined"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    common = {"system": str(options.system), "run": str(options.run), "hours": options.hours, "seed": options.seed}
    sets = [[], options.without] if options.without else [[]]
    conditions = [(noise, without) for noise in options.noise for without in sets]
    cases = [
        {**common, "folder": str(options.out), "noise": noise, "without": without, "index": index}
        for index in range(options.systems)
        for noise, without in conditions
    ]
    of = depends(options.system, run=options.run)
    rows = resumed(options.out / "cases.jsonl", cases, made, of=of, workers=options.workers)
    print(f"\n{options.systems} rooms, {options.hours:g} h, root seed {options.seed}, persons unknown")
    for noise, without in conditions:
        both = zip(cases, rows, strict=True)
        some = [row for case, row in both if (case["noise"], case["without"]) == (noise, without)]
        table(some, f"noise {noise}" + (f", without {' and '.join(without)}" if without else ""))


if __name__ == "__main__":
    main()
