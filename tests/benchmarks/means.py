"""What it buys that answers are made means: R2 and mean errors of answers as they are, and of estimates.

    python tests/benchmarks/means.py RUN [RUN ...] --dataset DATASET [--context 168] [--windows 800]
        [--without NAME ...]

Of all runs on the same windows, with clean and with noisy readings (``sensor``), with all sensors and without those
named. The dataset must be of a root seed that no training has seen. In brackets 90 % intervals by room; mean errors are
shares of the parameter's mean. A run that does not know how far its answers scatter has only the first.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch

from shared.metrics import r2
from shared.store import DatasetFolder, Records
from trainer.intervals import r2_interval
from trainer.reading.data import load_records
from trainer.reading.noise import Sensors
from trainer.reading.windows import WindowSource, disjoint_windows
from trainer.runs.checkpoint import Run, load_run
from trainer.runs.validation import Without


def scored(name: str, truth: np.ndarray, found: np.ndarray, where: np.ndarray) -> str:
    """A row: mean R2, R2 of each parameter and its mean error [%]; ``truth``, ``found`` are (windows, parameters)."""
    each, error = r2(truth, found), 100 * np.mean(found - truth, axis=0) / truth.mean(axis=0)
    (low,), (high,) = r2_interval(where, lambda rows: r2(truth[rows], found[rows]).mean(keepdims=True))
    cells = [f"{one:.2f} ({off:+.1f} %)" for one, off in zip(each, error, strict=True)]
    return f"| {name} | {each.mean():.3f} [{low:.2f}, {high:.2f}] | {' | '.join(cells)} |"


def compare(run: Run, name: str, dataset: DatasetFolder, records: Records, given: argparse.Namespace) -> None:
    """Print the rows of one run."""
    encoding = run.card.encoding
    if run.card.seen(dataset.manifest.system_hash, records).any():
        raise SystemExit(f"{dataset.folder}: {name} has seen some of its systems; expected another root seed")
    length = round(given.context * 3600 / encoding.step)
    where, starts = disjoint_windows(
        np.arange(len(records.systems)), len(records.time), length, given.windows, np.random.default_rng(given.seed)
    )
    truth = records.parameters[where]
    for noise in ("none", "sensor"):
        for absent in [given.without, []] if given.without else [[]]:
            source = WindowSource(
                records,
                encoding,
                Sensors(dataset.system, encoding.recorded, noise),
                torch.Generator().manual_seed(given.seed),
                Without(encoding.recorded, absent),
            )
            batch = source.gather(torch.from_numpy(where), torch.from_numpy(starts), length)
            answers = run.answers(batch.windows, batch.time)
            what = f"{name}, noise {noise}, " + (f"without {' '.join(absent)}" if absent else "all sensors")
            plain, means = encoding.estimates(answers), run.estimates(answers, length, absent)
            print(scored(f"{what}: answers", truth, plain, where), flush=True)
            if not np.array_equal(plain, means):
                print(scored(f"{what}: means", truth, means, where), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+")
    parser.add_argument("--dataset", type=Path, required=True)
    parser.add_argument("--context", type=float, default=168.0)
    parser.add_argument("--windows", type=int, default=800)
    parser.add_argument("--without", nargs="*", default=[])
    parser.add_argument("--seed", type=int, default=5)
    given = parser.parse_args()
    torch.set_num_threads(1)
    dataset, runs = DatasetFolder(given.dataset), [load_run(one) for one in given.runs]
    encoding = runs[0].card.encoding
    if any(one.card.encoding.recorded != encoding.recorded for one in runs):
        parser.error("the runs read different channels; expected the same, for the same windows")
    print(f"| estimator | mean R2 | {' | '.join(encoding.parameters)} |\n|{'---|' * (2 + len(encoding.parameters))}")
    records = load_records(dataset, encoding.recorded)
    for run, name in zip(runs, given.runs, strict=True):
        compare(run, name, dataset, records, given)


if __name__ == "__main__":
    main()
