"""What the farm costs around its simulations: start-up, a shard, scheduling; two workers against one; a large plan.

Run: ``python tests/benchmarks/scheduler.py [--shards 3000] [--rounds 3]``; on a machine that does nothing else.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import datagen.farming.collection
import datagen.farming.farm
from datagen import run
from datagen.farming.cluster import connect
from datagen.farming.dispatch import Dispatcher
from shared.store import Manifest, ShardEntry, write_manifest

HERE = Path(__file__).resolve().parents[2]


def nothing(number: int, payload: str) -> int:
    return number


@dataclass
class Course:
    """When things happened in one run of the farm [s of the clock], and what workers spent on each shard [s]."""

    began: float = 0.0
    asked: float = 0.0
    connected: float = 0.0
    ended: float = 0.0
    came: list[float] = field(default_factory=list)
    spent: list[float] = field(default_factory=list)


def course(workers: int, systems: int, hours: float) -> Course:
    """Run a farm with one system a shard and look on."""
    found = Course()
    take, enter = datagen.farming.collection.Collection.take, datagen.farming.farm.connect

    def watching(self, piece, result):
        take(self, piece, result)
        found.came.append(time.perf_counter())
        found.spent.append(result.seconds)

    @contextmanager
    def timed(**places):
        found.asked = time.perf_counter()
        with enter(**places) as client:
            found.connected = time.perf_counter()
            yield client

    datagen.farming.collection.Collection.take, datagen.farming.farm.connect = watching, timed
    try:
        with tempfile.TemporaryDirectory() as folder:
            size = {"systems": systems, "shard_size": 1, "hours": hours, "workers": workers}
            found.began = time.perf_counter()
            run(HERE / "fmus" / "MixedAirCO2", Path(folder) / "ds", **size, quiet=True)
            found.ended = time.perf_counter()
    finally:
        datagen.farming.collection.Collection.take, datagen.farming.farm.connect = take, enter
    return found


def rate(found: Course, workers: int) -> float:
    """Shards a second once every worker has done its first, and until the last workers run out of work."""
    came = found.came[workers : len(found.came) - workers]
    return (len(came) - 1) / (came[-1] - came[0])


def start_up() -> None:
    found = course(1, 60, 24.0)
    later = found.came[-1] - found.came[9]
    spent = statistics.mean(found.spent[10:])
    print("| start-up and shards, one worker, one system of 24 h a shard | [s] |")
    print("|---|---|")
    print(f"| description, FMU, parameters alive, manifest | {found.asked - found.began:.2f} |")
    print(f"| scheduler and worker process up | {found.connected - found.asked:.2f} |")
    first = found.came[0] - found.connected
    print(f"| first shard: the worker imports, unpacks the FMU, loads compiled code | {first:.2f} |")
    print(f"| a later shard, in the worker: simulate and write | {spent:.4f} |")
    print(f"| a later shard, all else: scheduling, sending, recording | {later / (len(found.came) - 10) - spent:.4f} |")
    print(f"| after the last shard: workers down, manifest, card | {found.ended - found.came[-1]:.2f} |\n")


def scaling(rounds: int, systems: int) -> None:
    rates: dict[int, list[float]] = {1: [], 2: []}
    for _ in range(rounds):
        for workers, seen in rates.items():
            seen.append(rate(course(workers, systems, 8760.0), workers))
    ratios = [two / one for one, two in zip(rates[1], rates[2], strict=True)]
    print("| year-long systems a second, one worker | two workers | ratio (each round) |")
    print("|---|---|---|")
    one, two = (statistics.median(rates[workers]) for workers in (1, 2))
    print(f"| {one:.2f} | {two:.2f} | {statistics.median(ratios):.2f} ({', '.join(f'{r:.2f}' for r in ratios)}) |\n")


def scheduling(shards: int) -> float:
    job = "x" * 10_000  # what a real job weighs
    with connect(workers=2) as client:
        list(Dispatcher(client, nothing, lambda n: (n, job), iter(range(50))))
        began = time.perf_counter()
        count = sum(1 for _ in Dispatcher(client, nothing, lambda n: (n, job), iter(range(shards))))
        cost = (time.perf_counter() - began) / count
    print("| scheduling alone | figure |")
    print("|---|---|")
    print(f"| shards that do nothing, two workers and scheduler on one machine | {1 / cost:.0f} a second |")
    print(f"| cost per shard | {1e3 * cost:.2f} ms |\n")
    return cost


def plan(cost: float, systems: int, workers: int, seconds: float) -> None:
    print(f"Plan: {systems} systems, {workers} workers, {seconds} s a system\n")
    print("| systems a shard | shards | scheduling in all [min] | simulation [min] | workers kept busy |")
    print("|---|---|---|---|---|")
    for size in (1, 10, 50, 100, 500):
        shards = -(-systems // size)
        scheduled = shards * cost / 60
        work = systems * seconds / workers / 60
        print(f"| {size} | {shards} | {scheduled:.1f} | {work:.1f} | {min(1.0, work / scheduled):.0%} |")
    size = 100
    entries = [
        ShardEntry(
            file=f"shard-{k:06d}.nc",
            systems=list(range(k * size, (k + 1) * size)),
            sha256="0" * 64,
            content_hash="0" * 64,
        )
        for k in range(systems // size)
    ]
    manifest = Manifest(
        system_name="x",
        system_hash="0",
        system="{}",
        fmu_sha256="0",
        root_seed=0,
        systems=systems,
        shard_size=size,
        shards=entries,
    )
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        write_manifest(Path(folder), manifest)
        took = time.perf_counter() - began
        weight = (Path(folder) / "manifest.json").stat().st_size
    print(f"\nIts manifest: {weight / 1e6:.1f} MB, {took:.2f} s to write, so every {max(5, 20 * took):.0f} s")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--shards", type=int, default=3000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--measured", type=int, default=40, help="systems in each run of the scaling table")
    parser.add_argument("--systems", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--seconds-per-system", type=float, default=0.5)
    options = parser.parse_args()
    print(f"load average at the start {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n")
    start_up()
    scaling(options.rounds, options.measured)
    plan(scheduling(options.shards), options.systems, options.workers, options.seconds_per_system)
    print(f"load average at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
