"""Latency of an estimate: from one recording in memory to its parameters, after loading the run once.

Run: ``python tests/benchmarks/latency.py RUN DATASET [--repeats 300]``; RUN is a folder of ``trainer fit``.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import torch

from shared.store import DatasetFolder
from trainer.reading.data import load_records
from trainer.runs.checkpoint import load_run


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=Path)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--repeats", type=int, default=300)
    options = parser.parse_args()
    torch.set_num_threads(1)
    began = time.perf_counter()
    run = load_run(options.run)
    loading = time.perf_counter() - began
    encoding = run.card.encoding
    dataset = DatasetFolder(options.dataset)
    count = len(load_records(dataset, []).systems)
    records = load_records(dataset, encoding.recorded, np.arange(min(count, 50)))
    rng = np.random.default_rng(0)
    spent = []
    for k in range(-10, options.repeats):  # the first ones warm up
        row = rng.integers(len(records.systems))
        start = rng.integers(len(records.time) - encoding.length + 1)
        window = records.values[row, :, start : start + encoding.length].T[None]
        stamp = np.array([records.starts[row] + records.time[start]])
        began = time.perf_counter()
        run.estimate(window, stamp)
        if k >= 0:
            spent.append(time.perf_counter() - began)
    middle, late = np.percentile(1000 * np.array(spent), [50, 95])
    print("| estimator | context [h] | channels | loading the run [ms] | estimate, median [ms] | estimate, p95 [ms] |")
    print("|---|---|---|---|---|---|")
    hours = encoding.length * encoding.step / 3600
    what = f"{run.card.model} | {hours:g} | {len(encoding.channels)}"
    print(f"| {what} | {1000 * loading:.1f} | {middle:.2f} | {late:.2f} |")


if __name__ == "__main__":
    main()
