"""How far finer walls than the model's put its parameters off, with its uncertain constants held and let free.

    python tests/benchmarks/finer_walls.py fmus/MixedAirCO2 --rooms 6 --seed 4000

Each room is simulated for a week by the truth of the blind check, which has finer walls, and by the model, with the
same parameters and persons; the difference of all readings is what a fit would have to explain. Solved as straight
lines, persons counted. Printed, means over rooms: how far that moves the parameters in posterior standard deviations
(root mean square, and the largest), the mean of these [prior standard deviations], and the misfit then: what is left
of the difference and what the prior takes for all moves together [squares].
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from datagen import simulate
from datagen.simulating.simulator import Simulator
from diagnosis.blind.truth import default_truth, load_truth
from diagnosis.fitting.lines import linearised
from diagnosis.fitting.problem import Problem
from diagnosis.recording import read_recording
from shared.system import System, load_system

HOURS = 168.0


def moved(system: System, path: Path, values: dict[str, float], *, replay: bool, free: bool) -> tuple[float, ...]:
    """Of one room: shift (rms, largest) [posterior sd], their mean [prior sd], and the misfit then [squares]."""
    record = read_recording(path, system)
    finer = load_truth(default_truth(system), system).described(system)
    finer = finer.with_experiment(step=record.step, hours=HOURS)
    common, known = {"occupancy": "measured", "replay": replay}, () if free else ("constants",)
    problem = Problem(Simulator(system.with_experiment(step=record.step)), record, known=known, **common)
    truth = Problem(Simulator(finer), record, known=["constants"], **common)
    z = problem.unknowns(values)
    around = problem.linearise(z)
    gap = problem.standardised(truth.simulate(truth.unknowns(values)) - problem.simulate(z))
    by_nuisance = around.response @ problem.nuisance.factor
    columns = np.hstack([problem.standardised(one) for one in (linearised(problem, z, around).by_unknown, by_nuisance)])
    covariance = np.linalg.inv(np.eye(columns.shape[1]) + columns.T @ columns)
    x = covariance @ (columns.T @ gap)
    count = len(system.parameters)
    sd = np.sqrt(np.diag(covariance))[:count]
    shift, left = x[:count] / sd, gap - columns @ x
    return float(np.sqrt(np.mean(shift**2))), float(np.abs(shift).max()), float(sd.mean()), float(left @ left + x @ x)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("system", type=Path)
    parser.add_argument("--rooms", type=int, default=6)
    parser.add_argument("--seed", type=int, default=4000)
    options = parser.parse_args()
    system = load_system(options.system).with_experiment(hours=HOURS, start=(0.0, 8760.0 - HOURS))
    print("| controllers | constants | shift / sd, rms | largest | sd | misfit |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        rooms = []
        for index in range(options.rooms):
            path = Path(folder) / f"{index}.nc"
            data = simulate(system, seed=options.seed, index=index, out=path)
            rooms.append((path, {name: float(data[name]) for name in system.parameter_names}))
        for replay in (False, True):
            for free in (False, True):
                found = np.mean([moved(system, *room, replay=replay, free=free) for room in rooms], axis=0)
                words = ("replayed" if replay else "simulated", "free" if free else "held")
                print(f"| {' | '.join(words)} | " + " | ".join(f"{one:.2f}" for one in found) + " |", flush=True)


if __name__ == "__main__":
    main()
