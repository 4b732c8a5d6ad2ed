"""How much narrower the other parameters become where some are known, by the linearised limit.

    python tests/benchmarks/known_parameters.py MixedAirCO2 roo.AFlo roo.V --systems 10 --seed SEED

A week of all outputs with the sensors' noise, weather and control known, occupants not counted, in random rooms whose
uncertain constants are drawn. Printed: the median over rooms of each parameter's posterior standard deviation [of its
prior], with nothing known and with those known, and of their ratio. The limit takes occupants for
Gaussian; as they are drawn, they tell more.
"""

from __future__ import annotations

import argparse

import numpy as np

from datagen.limits.ceilings import information
from datagen.limits.sensitivities import random_window
from shared.system import load_system


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("system")
    parser.add_argument("known", nargs="+", help="names of parameters")
    parser.add_argument("--systems", type=int, default=10)
    parser.add_argument("--context", type=float, default=168.0)
    parser.add_argument("--seed", type=int, required=True)
    options = parser.parse_args()
    system = load_system(options.system)
    names = list(system.parameter_names)
    free = [k for k, name in enumerate(names) if name not in options.known]
    windows = [random_window(system, options.context, options.seed, k, True) for k in range(options.systems)]
    states = np.concatenate([one.visited for one in windows])
    spread = np.cov(states, rowvar=False)
    before, after = [], []
    for window in windows:
        told = np.eye(len(names)) + information(system, window, spread, "sensor", list(system.output_names))
        before.append(np.sqrt(np.diag(np.linalg.inv(told)))[free])
        after.append(np.sqrt(np.diag(np.linalg.inv(told[np.ix_(free, free)]))))
    print(f"{options.systems} rooms of {system.name}, {options.context:g} h, root seed {options.seed}")
    print(f"\n| parameter | nothing known | {' and '.join(options.known)} known | ratio |\n|---|---|---|---|")
    ratio = np.median(np.array(after) / np.array(before), axis=0)
    for k, one, other, share in zip(free, np.median(before, axis=0), np.median(after, axis=0), ratio, strict=True):
        print(f"| {names[k]} | {one:.2f} | {other:.2f} | {share:.2f} |")


if __name__ == "__main__":
    main()
