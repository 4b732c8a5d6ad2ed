"""Training throughput: our sampler and loop beside a plain torch DataLoader loop, the same network, in turn.

Both take the same steps on windows of the same records, with the same loss and optimiser, on one thread. The plain loop
is the paper's section 2.4: a Dataset whose items are one random window each, and a DataLoader that stacks them. The
network alone, on a batch that is drawn once, says what is left to win. Time is the process's own, on one thread, so
that what else the machine does is not in it.

Run: ``python tests/benchmarks/training_throughput.py DATASET [--model patch-transformer] [--rounds 5]``.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from itertools import repeat
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from shared.store import DatasetFolder
from trainer.models import build, estimator_class
from trainer.reading.data import load_records
from trainer.reading.encoding import make_encoding
from trainer.reading.noise import Sensors
from trainer.reading.windows import Batch, Sampler, WindowSource, context_length
from trainer.runs.checkpoint import shape_of


class Windows(Dataset):
    """The paper's dataset: an item is a random window of a random system, normalised, and the system's target."""

    def __init__(self, source: WindowSource, size: int, seed: int) -> None:
        self.source, self.size = source, size
        self.rng = np.random.default_rng(seed)
        self.series = source.values.numpy()
        self.mean = np.array(source.encoding.mean, dtype=np.float32)
        self.sd = np.array(source.encoding.sd, dtype=np.float32)
        self.length = source.encoding.length

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, _: int) -> tuple[torch.Tensor, torch.Tensor]:
        row = self.rng.integers(len(self.series))
        start = self.rng.integers(self.series.shape[1] - self.length + 1)
        window = (self.series[row, start : start + self.length] - self.mean) / self.sd
        return torch.from_numpy(window), self.source.targets[row]


def ours(sampler: Sampler, batch_size: int, steps: int) -> Iterator[Batch]:
    for _ in range(steps):
        yield sampler.draw(batch_size)


def plain(source: WindowSource, batch_size: int, steps: int, seed: int) -> Iterator[Batch]:
    time_stamps = torch.zeros(batch_size, dtype=torch.float64)
    for windows, targets in DataLoader(Windows(source, batch_size * steps, seed), batch_size=batch_size):
        yield Batch(windows, time_stamps, targets)


def train(make: Callable[[], torch.nn.Module], batches: Iterator[Batch], lr: float) -> float:
    """Train as both loops do; returns the processor time it took [s]."""
    network = make()
    optimiser = torch.optim.Adamax(network.parameters(), lr=lr)
    network.train()
    began = time.process_time()
    for batch in batches:
        loss = torch.nn.functional.mse_loss(network(batch.windows, batch.time), batch.targets)
        loss.item()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--model", default="patch-transformer")
    parser.add_argument("--context", type=float, default=168.0)
    parser.add_argument("--batch-size", type=int)
    parser.add_argument("--steps", type=int, default=100, help="of one loop in one round")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--systems", type=int, default=1000, help="read at most so many")
    options = parser.parse_args()
    torch.set_num_threads(1)
    dataset = DatasetFolder(options.dataset)
    recorded = list(dataset.system.estimator.channels)
    rows = np.arange(min(options.systems, len(load_records(dataset, []).systems)))
    records = load_records(dataset, recorded, rows)
    length = context_length(options.context, records)
    encoding = make_encoding(dataset.system, records, [], length, rows)
    source = WindowSource(records, encoding, Sensors(dataset.system, recorded, "none"), torch.Generator())
    recipe = estimator_class(options.model).recipe
    batch_size, steps = options.batch_size or recipe.batch_size, options.steps

    def make() -> torch.nn.Module:
        torch.manual_seed(0)
        return build(options.model, shape_of(encoding), {})[0]

    loops: dict[str, Callable[[int], Iterator[Batch]]] = {
        "our sampler": lambda seed: ours(Sampler(source, rows, seed), batch_size, steps),
        "torch DataLoader": lambda seed: plain(source, batch_size, steps, seed),
        "one batch again and again": lambda seed: repeat(Sampler(source, rows, seed).draw(batch_size), steps),
    }
    seconds: dict[str, list[float]] = {name: [] for name in loops}
    loading: dict[str, list[float]] = {name: [] for name in loops}
    for seed in range(-1, options.rounds):
        for name, batches in loops.items():
            spent = train(make, batches(seed + 1), recipe.lr)
            began = time.process_time()
            for _ in batches(seed + 1):
                pass
            alone = time.process_time() - began
            if seed >= 0:  # the first round warms up
                seconds[name].append(spent)
                loading[name].append(alone)
    print(
        f"{options.model}, {options.context:g} h, {len(recorded)} channels, {batch_size} windows a step, {steps} steps,"
        f" {options.rounds} rounds in turn, one thread, processor time; medians\n"
    )
    print("| loop | windows per second | of a step, drawing the batch [ms] |")
    print("|---|---|---|")
    for name in loops:
        rate = batch_size * steps / statistics.median(seconds[name])
        print(f"| {name} | {rate:.0f} | {1000 * statistics.median(loading[name]) / steps:.3f} |")
    mine, theirs = seconds["our sampler"], seconds["torch DataLoader"]
    ratio = statistics.median(t / m for t, m in zip(theirs, mine, strict=True))
    only = statistics.median(t / m for t, m in zip(loading["torch DataLoader"], loading["our sampler"], strict=True))
    print(f"\nratio of windows per second, ours to the DataLoader's: {ratio:.2f}; drawing alone: {only:.1f}")


if __name__ == "__main__":
    main()
