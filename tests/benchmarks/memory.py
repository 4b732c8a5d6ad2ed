"""Memory of a worker over many systems. Run: ``python tests/benchmarks/memory.py [--systems 2000] [--hours 24]``."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import datagen.farming.collection
from datagen import run
from datagen.farming.plan import Piece
from datagen.farming.worker import ShardResult

HERE = Path(__file__).resolve().parents[2]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--systems", type=int, default=2000)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--system", type=Path, default=HERE / "fmus" / "MixedAirCO2")
    options = parser.parse_args()
    seen: list[tuple[int, int, int]] = []
    take = datagen.farming.collection.Collection.take

    def watching(self: datagen.farming.collection.Collection, piece: Piece, result: ShardResult) -> None:
        seen.append((len(piece.systems), result.pid, result.rss))
        take(self, piece, result)

    datagen.farming.collection.Collection.take = watching  # type: ignore[method-assign]
    with tempfile.TemporaryDirectory() as folder:
        run(
            options.system,
            Path(folder) / "ds",
            systems=options.systems,
            hours=options.hours,
            workers=1,
            quiet=True,
            recycle=float("inf"),
        )
    print("| systems simulated | worker | memory [MiB] |")
    print("|---|---|---|")
    done, marks = 0, iter(range(1, 12))
    mark = next(marks)
    for count, pid, rss in seen:
        done += count
        if done >= mark * options.systems / 10 or done == count:
            print(f"| {done} | {pid} | {rss / 2**20:.1f} |")
            while done >= mark * options.systems / 10:
                mark = next(marks)


if __name__ == "__main__":
    main()
