"""Why the default system is what it is: ceilings and plausibility for other controllers, heaters, windows, excitations.

For each variant of the default system: the mean limit of R2 over the parameters (7 days, temperature and CO2,
occupancy unknown), noise-free and with sensor noise, and the share of hours within 5..40 degC and below 5000 ppm over
as many other random systems of the whole box. Run: ``python tests/benchmarks/design.py [--systems 8] [--workers 2]``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from datagen.limits.ceilings import ceilings_of
from datagen.simulating.drawn import simulate_system
from datagen.simulating.simulator import Simulator
from shared.system import System, load_system

HERE = Path(__file__).resolve().parents[2]
TIGHT = {"conHea.k": 2.0, "conHea.Ti": 1800.0}
VARIANTS: dict[str, tuple[dict[str, float], float]] = {
    "default": ({}, 1.0),
    "tight heating control (0.5 K band, 0.5 h)": (TIGHT, 1.0),
    "wider band (8 K, 8 h)": ({"conHea.k": 0.125, "conHea.Ti": 28800.0}, 1.0),
    "heater 5 kW": ({"QHea_max": 5000.0}, 1.0),
    "heater 20 kW": ({"QHea_max": 20000.0}, 1.0),
    "window 20 %": ({"fraWin": 0.2}, 1.0),
    "window 30 %": ({"fraWin": 0.3}, 1.0),
    "no excitation": ({}, 0.0),
    "excitation x 3": ({}, 3.0),
}


def variant(system: System, fixed: dict[str, float], excitation: float) -> System:
    raw = json.loads(system.canonical())
    raw["fixed"].update(fixed)
    for table in raw["excitations"].values():
        for component in table["components"]:
            component["amplitude"] *= excitation
    return System.model_validate({**raw, "path": system.path})


def plausible(system: System, systems: int) -> tuple[float, float]:
    simulator = Simulator(system)
    shares = []
    for index in range(systems):
        outputs = dict(
            zip(system.output_names, simulate_system(simulator, root_seed=11, index=index).outputs, strict=True)
        )
        celsius = outputs["TRoo"] - 273.15
        shares.append(np.mean((celsius >= 5) & (celsius <= 40) & (outputs["CO2"] < 5000)))
    return float(np.mean(shares)), float(np.min(shares))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--systems", type=int, default=8)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    base = load_system(HERE / "fmus" / "MixedAirCO2")
    print("| variant | noise-free | weakest | sensor noise | weakest | plausible hours | worst system |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for name, (fixed, excitation) in VARIANTS.items():
        system = variant(base, fixed, excitation)
        free, noisy = ceilings_of(
            system,
            contexts=[168.0],
            conditions=[("none", None), ("sensor", None)],
            systems=options.systems,
            workers=options.workers,
        )
        cells = []
        for one in (free, noisy):
            weakest = min(one.r2, key=lambda p: one.r2[p])
            cells += [f"{one.r2_mean:.3f}", f"{weakest} {one.r2[weakest]:.2f}"]
        mean, worst = plausible(system, options.systems)
        print(f"| {name} | {' | '.join(cells)} | {mean:.2%} | {worst:.2%} |", flush=True)


if __name__ == "__main__":
    main()
