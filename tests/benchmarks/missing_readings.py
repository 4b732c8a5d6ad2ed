"""What missing readings cost: R2 of an estimator where a share of its outputs' readings is removed.

Each share three ways: as one gap in each output; one by one, as they are; and the same ones put in on straight lines,
as ``trainer predict`` does it.

    python tests/benchmarks/missing_readings.py RUN DATASET [--noise sensor] [--context 168] [--windows 800]
        [--shares 0.02 0.05 0.1] [--without NAME ...]

The dataset must be of a root seed that no training has seen. In brackets 90 % intervals by room.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
import torch

from shared.metrics import r2
from shared.store import DatasetFolder
from shared.stretches import bridge
from trainer.intervals import r2_interval
from trainer.predicting.recorded import BRIDGED
from trainer.reading.data import load_records
from trainer.reading.noise import Sensors
from trainer.reading.windows import WindowSource, disjoint_windows
from trainer.runs.checkpoint import load_run

Lose = Callable[[np.ndarray, np.random.Generator], None]


def one_gap(values: np.ndarray, rng: np.random.Generator, share: float) -> None:
    """Remove one stretch of a series (steps,)."""
    length = round(share * len(values))
    first = rng.integers(len(values) - length + 1)
    values[first : first + length] = np.nan


def one_by_one(values: np.ndarray, rng: np.random.Generator, share: float) -> None:
    """Remove single readings of a series (steps,)."""
    values[rng.choice(len(values), round(share * len(values)), replace=False)] = np.nan


def put_in(values: np.ndarray, rng: np.random.Generator, share: float) -> None:
    """The same, put in on straight lines where few are missing in a row."""
    one_by_one(values, rng, share)
    bridge(values, BRIDGED)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("run")
    parser.add_argument("dataset")
    parser.add_argument("--noise", default="sensor")
    parser.add_argument("--context", type=float, default=168.0)
    parser.add_argument("--windows", type=int, default=800)
    parser.add_argument("--shares", type=float, nargs="+", default=[0.02, 0.05, 0.1])
    parser.add_argument("--without", nargs="*", default=[])
    options = parser.parse_args()
    torch.set_num_threads(1)
    run, dataset = load_run(options.run), DatasetFolder(options.dataset)
    encoding = run.card.encoding
    records = load_records(dataset, encoding.recorded)
    if run.card.seen(dataset.manifest.system_hash, records).any():
        parser.error(f"{options.dataset}: the run has seen some of its systems; expected another root seed")
    length = round(options.context * 3600 / encoding.step)
    where, starts = disjoint_windows(
        np.arange(len(records.systems)), len(records.time), length, options.windows, np.random.default_rng(1)
    )
    absent = torch.tensor([name in options.without for name in encoding.recorded])
    present = [k for k in range(encoding.outputs) if not absent[k]]

    def scores(lose: Lose) -> str:
        def gaps(values: torch.Tensor, _: torch.Generator) -> torch.Tensor:
            rng = np.random.default_rng(2)
            shown = values.masked_fill(absent, torch.nan).numpy().copy()
            for window in shown:
                for k in present:
                    lose(window[:, k], rng)
            return torch.from_numpy(shown)

        sensors = Sensors(dataset.system, encoding.recorded, options.noise)
        source = WindowSource(records, encoding, sensors, torch.Generator().manual_seed(3), gaps)
        batch = source.gather(torch.from_numpy(where), torch.from_numpy(starts), length)
        answers = run.answers(batch.windows, batch.time)
        found, truth = run.estimates(answers, length, options.without), records.parameters[where]
        (low,), (high,) = r2_interval(where, lambda rows: r2(truth[rows], found[rows]).mean(keepdims=True))
        return f"{r2(truth, found).mean():.3f} [{low:.2f}, {high:.2f}]"

    print(
        f"{len(where)} windows of {options.context:g} h, noise {options.noise}; none missing: {scores(lambda *_: None)}"
    )
    print("| missing | one gap | one by one | put in |\n|---|---|---|---|")
    for share in options.shares:
        ways = (one_gap, one_by_one, put_in)
        cells = [scores(lambda v, rng, way=way, share=share: way(v, rng, share)) for way in ways]  # type: ignore[misc]
        print(f"| {share:.0%} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
