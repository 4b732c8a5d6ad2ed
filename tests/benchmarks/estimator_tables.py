"""What an estimator reaches on rooms never seen, beside the limit: the tables of docs/results.md.

    python tests/benchmarks/estimator_tables.py RUN --rooms NAME=DATASET [NAME=DATASET ...] --out tables

For each dataset, noise (``none``, ``sensor``) and set of sensors (with and without the outputs of ``--without``): the
mean R2 by context, with 90 % intervals by room, and R2 by parameter at the run's own context. Datasets must be of root
seeds that no training has seen. The limit is that of ``--ceilings`` for the constants that a dataset has; there is none
for rooms without excitation.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

from resumed import resumed

import trainer
from diagnosis.blind.running import program
from shared.store import DatasetFolder, sha256_of
from trainer.evaluating.limit import find_ceiling

NOISES = {"none": "Clean readings", "sensor": "Noisy readings"}


def made(case: dict[str, Any]) -> dict[str, Any]:
    """R2 of one dataset under one condition."""
    with tempfile.TemporaryDirectory() as folder:
        found = trainer.evaluate(
            case["run"],
            case["dataset"],
            windows=case["windows"],
            seed=case["seed"],
            noise=case["noise"],
            context_hours=case["hours"],
            without=case["without"],
            out=folder,
        ).protocols["unseen"]
    return {"r2": {**found.r2, "mean": found.r2_mean}, "interval": found.r2_mean_interval}


def limits(case: dict[str, Any], ceilings: Path) -> dict[str, float]:
    """The limit by parameter for a case's context, noise, sensors and constants; empty where there is none."""
    dataset, card = DatasetFolder(case["dataset"]), trainer.load_run(case["run"]).card
    channels = [name for name in card.encoding.recorded if name not in case["without"]]
    limit, said = find_ceiling(card, dataset, ceilings, hours=case["hours"], noise=case["noise"], channels=channels)
    print(said)
    return {} if limit is None else {**limit.r2, "mean": limit.r2_mean}


def table(first: str, heads: list[str], rows: list[tuple[str, list[str]]]) -> None:
    """Print rows of cells in Markdown."""
    print(f"\n| {first} | {' | '.join(heads)} |\n|{'---|' * (1 + len(heads))}")
    for name, cells in rows:
        print(f"| {name} | {' | '.join(cells)} |")


def number(value: float | None) -> str:
    """Two digits, or nothing."""
    return "" if value is None else f"{value:.2f}"


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run")
    parser.add_argument("--rooms", nargs="+", required=True, help="NAME=DATASET of rooms never seen")
    parser.add_argument("--ceilings", type=Path, required=True, help="file of datagen identifiability")
    parser.add_argument("--contexts", nargs="*", type=float, help="in hours; by default all that the run reads")
    parser.add_argument("--without", nargs="*", default=[], help="outputs that were not measured, in a second set")
    parser.add_argument("--windows", type=int, default=800)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    rooms, card = dict(one.split("=", 1) for one in given.rooms), trainer.load_run(given.run).card
    contexts = given.contexts or [length * card.encoding.step / 3600 for length in card.encoding.lengths]
    columns = [(without, name) for without in ([given.without, []] if given.without else [[]]) for name in rooms]
    cases = [
        {
            "run": given.run,
            "dataset": rooms[name],
            "hours": hours,
            "noise": noise,
            "without": without,
            "windows": given.windows,
            "seed": given.seed,
        }
        for hours in contexts
        for noise in NOISES
        for without, name in columns
    ]
    of = {"program": program(), "run": card.weights_sha256}
    of |= {one: sha256_of(Path(one) / "manifest.json") for one in rooms.values()}
    answers = resumed(given.out / "cases.jsonl", cases, made, of=of, workers=given.workers)
    told = iter([(one, limits(case, given.ceilings)) for one, case in zip(answers, cases, strict=True)])
    found = {(hours, noise): [next(told) for _ in columns] for hours in contexts for noise in NOISES}
    heads = []
    for without, name in columns:
        sensors = f"without {' '.join(without)}" if without else "all sensors"
        heads += [f"{sensors}, {name}", "limit"]
    for noise, title in NOISES.items():
        print(f"\n{title}:")
        rows = []
        for hours in contexts:
            cells = []
            for one, limit in found[hours, noise]:
                low, high = one["interval"]
                cells += [f"{one['r2']['mean']:.2f} [{low:.2f}, {high:.2f}]", number(limit.get("mean"))]
            rows.append((f"{hours / 24:g} d", cells))
        table("context", heads, rows)
        if card.context_hours in contexts:
            rows = []
            for name in [*card.encoding.parameters, "mean"]:
                pairs = [(one["r2"][name], limit.get(name)) for one, limit in found[card.context_hours, noise]]
                rows.append((name, [number(value) for pair in pairs for value in pair]))
            table(f"{card.context_hours / 24:g} d", heads, rows)


if __name__ == "__main__":
    main()
