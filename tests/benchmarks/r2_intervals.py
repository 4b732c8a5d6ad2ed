"""How often 90 % intervals of a mean R2 hold it: percentiles of resamples of rooms, and leaving out one after another.

    python tests/benchmarks/r2_intervals.py

Rooms are made up: eight parameters, drawn evenly; normal errors of two windows a room, seven tenths of whose variance
is the room's own. R2 over all rooms there could be is then known; another one for all of them changes no share. Printed
for each number of rooms: the share of the draws whose interval holds it, by percentiles of resamples
(``bootstrap_by_system``) and by leaving out (``trainer.intervals.r2_interval``).
"""

from __future__ import annotations

import argparse

import numpy as np
from resampling import bootstrap_by_system

from shared.metrics import r2
from trainer.intervals import r2_interval

ALIKE = np.full(8, 0.6)
UNLIKE = np.array([0.9, 0.2, 0.3, 0.5, 0.6, 0.7, 0.8, 0.8])
WINDOWS = 2
SHARED = 0.7
"""Of the variance of the errors, by the windows of a room."""


def draw(rooms: int, true: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Room (windows,), truth and estimate (windows, 8) of rooms with these R2 (8,)."""
    truth, scale = rng.uniform(size=(rooms, len(true))) * np.sqrt(12), np.sqrt(1 - true)
    where = np.repeat(np.arange(rooms), WINDOWS)
    own = np.sqrt(SHARED) * rng.standard_normal(truth.shape)
    rest = np.sqrt(1 - SHARED) * rng.standard_normal((len(where), len(true)))
    return where, truth[where], truth[where] + scale * (own[where] + rest)


def held(rooms: int, true: np.ndarray, draws: int, seed: int) -> np.ndarray:
    """Share of the draws whose interval of the mean R2 holds it, by both methods (2,)."""
    rng, found = np.random.default_rng(seed), np.zeros(2)
    for one in range(draws):
        where, truth, estimate = draw(rooms, true, rng)

        def mean(rows: np.ndarray, truth: np.ndarray = truth, estimate: np.ndarray = estimate) -> np.ndarray:
            return np.asarray(r2(truth[rows], estimate[rows]).mean())

        for k, (low, high) in enumerate((bootstrap_by_system(where, mean, seed=one), r2_interval(where, mean))):
            found[k] += low <= true.mean() <= high
    return found / draws


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", type=int, nargs="+", default=[10, 17, 50, 400])
    parser.add_argument("--draws", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    kinds = {"all 0.6": ALIKE, "0.2 to 0.9": UNLIKE}
    print(f"| rooms | {' | '.join(f'R2 {kind}: resampled | left out' for kind in kinds)} |")
    print(f"|{'---|' * (1 + 2 * len(kinds))}")
    for rooms in options.rooms:
        cells = [100 * share for true in kinds.values() for share in held(rooms, true, options.draws, options.seed)]
        print(f"| {rooms} | {' | '.join(f'{one:.0f} %' for one in cells)} |", flush=True)


if __name__ == "__main__":
    main()
