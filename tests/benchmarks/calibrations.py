"""What calibrating adds to an estimate: R2, intervals and simulations, in rooms never seen.

    python tests/benchmarks/calibrations.py MixedAirCO2 --systems 50 --seed SEED --out calibrations

Each room has its uncertain constants drawn, and a week of noisy readings from anywhere in the year. ``diagnosis
calibrate`` begins at the estimator's answer (*warm*), with occupants counted and not, and where they are counted also
at the middle of the prior (*cold*). *As plausible* is within half the number of parameters in log evidence: so far a
draw of the posterior lies below its best. Intervals are by room. Take a seed that nothing was developed on.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from resumed import depends, resumed

from datagen import simulate
from diagnosis.calibrating.calibration import calibrate
from diagnosis.usual import HALF_WIDTH
from shared.errors import ZeroshotError
from shared.metrics import r2
from shared.system import load_system
from trainer.intervals import r2_interval, share_interval

KINDS = {"counted, warm": ("measured", True), "counted, cold": ("measured", False), "not counted": ("unknown", True)}


def made(case: dict[str, Any]) -> dict[str, Any]:
    """One room: its parameters, the estimate, and the calibrations."""
    hours, seed, index = case["hours"], case["seed"], case["index"]
    system = load_system(case["system"]).with_experiment(hours=hours, start=(0.0, 8760.0 - hours))
    replay = case["replay"]
    record = simulate(system, seed=seed, index=index, uncertain=True, noise="sensor")
    truth = {name: float(record[name]) for name in system.parameter_names}
    found: dict[str, Any] = {"truth": [*truth.values()]}
    for kind, (occupancy, warm) in KINDS.items():
        began = time.process_time()
        try:
            done = calibrate(
                system, record, run=case["run"] if warm else None, occupancy=occupancy, replay=replay, starts=1
            )
        except ZeroshotError as error:
            return {"error": f"{kind}: {error}"}
        told, count = done.report.parameters, len(truth)
        sd = np.sqrt(np.diag(done.report.covariance))[:count]
        found[kind] = {
            "values": [one.value for one in told],
            "off": ((done.fit.z - done.problem.unknowns(truth))[:count] / sd).tolist(),
            "evidence": done.fit.log_evidence,
            "converged": done.report.converged,
            "simulations": done.report.simulations,
            "seconds": time.process_time() - began,
        }
        if kind == "counted, warm":
            found["zero-shot"] = [one.zero_shot for one in told]
    return found


def spread(values: Sequence[float]) -> str:
    """Median, and the 10 and 90 % quantiles."""
    low, half, high = np.quantile(values, [0.1, 0.5, 0.9])
    return f"{half:.0f} [{low:.0f}, {high:.0f}]"


def accuracy(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> None:
    """Print R2 of each parameter over the rooms: the estimator's alone, and calibrated from there."""
    truth = np.array([row["truth"] for row in rows])
    given = [
        np.array([row["zero-shot"] for row in rows]),
        *(np.array([row[kind]["values"] for row in rows]) for kind in KINDS),
    ]

    def scores(some: np.ndarray) -> np.ndarray:
        each = [r2(truth[some], one[some]) for one in given]
        return np.array([[*one, one.mean()] for one in each])

    every = np.arange(len(rows))
    found, (low, high) = scores(every), r2_interval(every, scores)
    print(f"\n| R2 | zero-shot | {' | '.join(KINDS)} |\n|---|---|{'---|' * len(KINDS)}")
    for k, name in enumerate([*names, "mean"]):
        cells = [f"{found[m, k]:.2f} [{low[m, k]:.2f}, {high[m, k]:.2f}]" for m in range(len(given))]
        print(f"| {name} | {' | '.join(cells)} |")


def effort(rows: Sequence[dict[str, Any]]) -> None:
    """Print how well intervals cover, and what each kind of calibration takes."""
    print("\n| calibrated | 90 % intervals that cover | error / stated sd, rms | converged | simulations | seconds |")
    print("|---|---|---|---|---|---|")
    for kind in KINDS:
        some = [row[kind] for row in rows]
        off = np.array([one["off"] for one in some])
        inside = (np.abs(off) < HALF_WIDTH).mean(axis=1)
        low, high = share_interval(np.arange(len(rows)), inside)
        print(
            f"| {kind} | {inside.mean():.0%} [{low:.0%}, {high:.0%}] | {np.sqrt(np.mean(off**2)):.2f}"
            f" | {sum(one['converged'] for one in some)} of {len(some)}"
            f" | {spread([one['simulations'] for one in some])} | {spread([one['seconds'] for one in some])} |"
        )
    warm, cold = ([row[kind] for row in rows] for kind in list(KINDS)[:2])
    shares = np.array([one["simulations"] / other["simulations"] for one, other in zip(warm, cold, strict=True)])
    rng = np.random.default_rng(0)
    low, high = np.quantile(
        np.median(shares[rng.integers(len(shares), size=(1000, len(shares)))], axis=1), [0.05, 0.95]
    )
    lead = np.array([one["evidence"] - other["evidence"] for one, other in zip(warm, cold, strict=True)])
    half = 0.5 * len(rows[0]["truth"])
    print(f"\nwarm / cold simulations, median: {np.median(shares):.2f} [{low:.2f}, {high:.2f}]")
    print(f"as plausible: both {np.sum(np.abs(lead) <= half)}, warm alone {np.sum(lead > half)},", end=" ")
    print(f"cold alone {np.sum(lead < -half)} of {len(lead)}")


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system")
    parser.add_argument("--run", help="an estimator's folder; that of the system, if not given")
    parser.add_argument("--systems", type=int, default=50)
    parser.add_argument("--hours", type=float, default=168.0)
    parser.add_argument("--seed", type=int, required=True, help="root seed")
    parser.add_argument("--replay", action="store_true", help="actuators as they were measured")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("calibrations"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    run = options.run or options.system
    common = {"system": options.system, "run": run, "replay": options.replay, "hours": options.hours}
    cases = [{**common, "seed": options.seed, "index": index} for index in range(options.systems)]
    rows = resumed(
        options.out / "cases.jsonl", cases, made, of=depends(options.system, run=run), workers=options.workers
    )
    good = [row for row in rows if "error" not in row]
    print("\n".join(row["error"] for row in rows if "error" in row))
    print(f"\n{len(good)} of {len(rows)} rooms, {options.hours:g} h, root seed {options.seed}")
    accuracy(good, load_system(options.system).parameter_names)
    effort(good)


if __name__ == "__main__":
    main()
