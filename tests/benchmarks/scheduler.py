"""What scheduling costs: shards that do nothing, through the farm's dispatcher; then a million systems, by arithmetic.

Run: ``python tests/benchmarks/scheduler.py [--shards 3000]``.
"""

from __future__ import annotations

import argparse
import time

from datagen.cluster import connect
from datagen.dispatch import Dispatcher
from shared.store import Manifest, ShardEntry, write_manifest


def nothing(number: int, payload: str) -> int:
    return number


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--shards", type=int, default=3000)
    parser.add_argument("--systems", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--seconds-per-system", type=float, default=0.5)
    options = parser.parse_args()
    job = "x" * 10_000  # what a real job weighs
    with connect(workers=2, quiet=True) as client:
        list(Dispatcher(client, nothing, lambda n: (n, job), iter(range(50))))
        began = time.perf_counter()
        count = sum(1 for _ in Dispatcher(client, nothing, lambda n: (n, job), iter(range(options.shards))))
        cost = (time.perf_counter() - began) / count
    print("| what | figure |")
    print("|---|---|")
    print(f"| shards that do nothing, two workers and scheduler on one machine | {1 / cost:.0f} a second |")
    print(f"| cost per shard | {1e3 * cost:.2f} ms |")
    print(f"\nPlan: {options.systems} systems, {options.workers} workers, {options.seconds_per_system} s a system\n")
    print("| systems a shard | shards | scheduling in all [min] | simulation [min] | workers kept busy |")
    print("|---|---|---|---|---|")
    for size in (1, 10, 50, 100, 500):
        shards = -(-options.systems // size)
        scheduling = shards * cost / 60
        work = options.systems * options.seconds_per_system / options.workers / 60
        busy = min(1.0, work / scheduling)
        print(f"| {size} | {shards} | {scheduling:.1f} | {work:.1f} | {busy:.0%} |")
    import tempfile
    from pathlib import Path

    size = 100
    entries = [
        ShardEntry(
            file=f"shard-{k:06d}.nc",
            systems=list(range(k * size, (k + 1) * size)),
            sha256="0" * 64,
            content_hash="0" * 64,
        )
        for k in range(options.systems // size)
    ]
    manifest = Manifest(
        system_name="x",
        system_hash="0",
        system="{}",
        fmu_sha256="0",
        root_seed=0,
        systems=options.systems,
        shard_size=size,
        shards=entries,
    )
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        write_manifest(Path(folder), manifest)
        took = time.perf_counter() - began
        weight = (Path(folder) / "manifest.json").stat().st_size
    print(f"\nIts manifest: {weight / 1e6:.1f} MB, {took:.2f} s to write, so every {max(5, 20 * took):.0f} s")


if __name__ == "__main__":
    main()
