"""How honest a calibration's intervals are: errors in posterior standard deviations, over recordings never used before.

    python tests/benchmarks/intervals.py fmus/MixedAirCO2 --blind blind --answers blind.answers.json --out intervals

The recordings are those without an effect of opened blind checks, whose walls are finer than the model's, each with
the persons and the actuators that it was made with (in ``replay`` the measured heater and air flow stand in place of
the controllers). Printed: the root mean square of (estimate - truth) / standard deviation in the scale in which the
prior is standard normal (1 for a Gaussian posterior), the share of 90 % intervals that hold the truth, and how wide
they are. Recordings are the independent draws: the interval of each figure is a bootstrap over them.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from resumed import depends, resumed

from diagnosis.calibrating.calibration import calibrate
from diagnosis.recording import Recording
from diagnosis.usual import HALF_WIDTH
from shared.errors import ZeroshotError
from shared.system import System, load_system

KINDS: dict[str, dict[str, Any]] = {
    "measured": {"occupancy": "measured"},
    "unknown": {"occupancy": "unknown"},
    "replay": {"occupancy": "measured", "replay": True},
    "unknown, replay": {"occupancy": "unknown", "replay": True},
}


def noisy(record: Recording, system: System, rng: np.random.Generator, preset: str = "sensor") -> Recording:
    """A recording as the sensors of a preset show it: noise, rounding, lost readings."""
    shown = record.outputs.copy()
    for k, output in enumerate(system.outputs):
        sensor = output.noise[preset]
        shown[k] += sensor.sd * rng.standard_normal(shown.shape[1])
        shown[k] = np.round(shown[k] / sensor.quantum) * sensor.quantum if sensor.quantum else shown[k]
        shown[k, rng.random(shown.shape[1]) < sensor.dropout] = np.nan
    return replace(record, outputs=shown)


def opened(case: dict[str, Any], system: System) -> tuple[Path, dict[str, float]]:
    """A recording of an opened blind check, and its room's parameters [unit of each]."""
    answers = json.loads(Path(case["answers"]).read_text())["recordings"]
    truth = next(one["parameters"] for one in answers if one["file"] == case["file"])
    return Path(case["blind"]) / case["file"], {name: truth[name] for name in system.parameter_names}


def without_effect(folder: Path, answers: Path) -> list[dict[str, Any]]:
    """Cases of an opened blind check in whose recordings nothing is wrong but the walls."""
    kinds = {(kind["occupancy"], kind.get("replay", False)): name for name, kind in KINDS.items()}
    where = {"blind": str(folder), "answers": str(answers)}
    return [
        {**where, "file": one["file"], "kind": kinds[one["occupancy"], one["replay"]]}
        for one in json.loads(answers.read_text())["recordings"]
        if one["stratum"] == "none"
    ]


def made(case: dict[str, Any]) -> dict[str, Any]:
    """One calibration, and the truth."""
    system = load_system(case["system"])
    began = time.process_time()
    try:
        record, truth = opened(case, system)
        done = calibrate(system, record, starts=case["starts"], **KINDS[case["kind"]])
    except ZeroshotError as error:
        return {"error": str(error)}
    count = len(truth)
    widened = np.sqrt(np.diag(done.report.covariance))[:count]
    return {
        "truth": done.problem.unknowns(truth)[:count].tolist(),
        "z": done.fit.z[:count].tolist(),
        "sd": widened.tolist(),
        "plain": done.fit.sd[:count].tolist(),
        "levels": done.fit.z[count:].tolist(),
        "converged": done.fit.converged,
        "simulations": done.fit.simulations,
        "seconds": time.process_time() - began,
        "chi2": {name: one.chi2 for name, one in done.report.outputs.items()},
    }


def figure(values: np.ndarray, what: str) -> str:
    """A statistic of errors in standard deviations (recordings, parameters), with a 90 % bootstrap interval."""

    def of(rows: np.ndarray) -> float:
        return float(np.sqrt(np.mean(rows**2)) if what == "rms" else np.mean(np.abs(rows) < HALF_WIDTH))

    rng = np.random.default_rng(0)
    again = [of(values[rng.integers(len(values), size=len(values))]) for _ in range(1000)]
    low, high = np.quantile(again, [0.05, 0.95])
    return f"{of(values):.2f} [{low:.2f}, {high:.2f}]"


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system", type=Path)
    parser.add_argument("--starts", type=int, default=2)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--blind", type=Path, nargs="+", required=True, help="folders of opened blind checks")
    parser.add_argument("--answers", type=Path, nargs="+", required=True, help="their answers, in the same order")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("intervals"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    common = {"system": str(options.system), "starts": options.starts}
    several = zip(options.blind, options.answers, strict=True)
    cases = [common | one for where in several for one in without_effect(*where) if one["kind"] in options.kinds]
    of = depends(options.system, files=options.answers)
    rows = resumed(options.out / "cases.jsonl", cases, made, of=of, workers=options.workers)
    names = load_system(options.system).parameter_names
    print(f"\n{len(cases)} recordings without an effect\n")
    print(
        "| persons | calibrated | error / sd, rms | in 90 % interval | largest | not widened | sd, median | seconds |\n"
        "|---|---|---|---|---|---|---|---|"
    )
    errors: dict[str, np.ndarray] = {}
    for kind in options.kinds:
        found = [row for case, row in zip(cases, rows, strict=True) if case["kind"] == kind]
        good = [row for row in found if "error" not in row]
        if not good:
            continue
        off, sd, plain = (np.array([row[key] for row in good]) for key in ("truth", "sd", "plain"))
        off = np.array([row["z"] for row in good]) - off
        errors[kind] = off / sd
        print(
            f"| {kind} | {len(good)} of {len(found)} | {figure(off / sd, 'rms')} | {figure(off / sd, 'share')} "
            f"| {np.abs(off / sd).max():.1f} | {figure(off / plain, 'rms')}, {figure(off / plain, 'share')} "
            f"| {np.median(sd):.3f} | {np.median([row['seconds'] for row in good]):.1f} |"
        )
    print("\n| parameter | " + " | ".join(f"{kind}: rms, share" for kind in errors) + " |")
    print("|---" * (len(errors) + 1) + "|")
    for k, name in enumerate(names):
        columns = [one[:, k] for one in errors.values()]
        told = [f"{np.sqrt(np.mean(e**2)):.2f}, {np.mean(np.abs(e) < HALF_WIDTH):.2f}" for e in columns]
        print(f"| {name} | " + " | ".join(told) + " |")


if __name__ == "__main__":
    main()
