"""What answers and intervals are worth on rows of `diagnosis farm` that they were not calibrated by.

    diagnosis farm MixedAirCO2 --recordings 60 --seed 20261208 --out farm
    python tests/benchmarks/fresh_farm.py farm [--verdict fmus/MixedAirCO2/verdict.json]

Without --verdict each row is judged by weights, limits and doubt of the other nine tenths of the farm.
Shares have 95 % intervals (Wilson). Intervals of parameters are those of rows whose cause, or that there is none, was
found; their values are not independent within a row, so the interval is a bootstrap's over rows.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from diagnosis.farming.calibration import OUTSIDE, apart
from diagnosis.farming.rows import Row, Rows, read_row
from diagnosis.fitting.fit import doubted_sd
from diagnosis.gap.verdict import Decision, decide
from diagnosis.usual import HALF_WIDTH
from diagnosis.verdicts import Verdicts, read_verdicts
from shared.errors import RecordingError
from shared.metrics import wilson
from shared.reading import read_json

Z = 1.96
BINS = ((0.0, 0.2), (0.2, 0.8), (0.8, 1.0))
Done = list[tuple[Row, Decision]]


def line(what: str, hits: Sequence[bool], said: Sequence[float] = ()) -> None:
    count = len(hits)
    if not count:
        print(f"| {what} | - | |")
        return
    low, high = wilson(np.mean(hits), count, Z)
    mean = f"{np.mean(said):.0%}" if len(said) else ""
    print(f"| {what} | {sum(hits)} of {count} ({np.mean(hits):.0%}, {100 * low:.0f} to {100 * high:.0f}) | {mean} |")


def holds(row: Row, done: Decision) -> bool:
    """Whether the answer's set has what is true."""
    if row.stratum in OUTSIDE:
        return done.or_none or done.verdict == "none_of_these"
    return any(name in row.true for name in (*done.named, *done.possible))


def answers(done: Done) -> None:
    line("gaps answered where there is no cause", [d.verdict != "no_gap" for r, d in done if r.stratum == "none"])
    named = [(r, d) for r, d in done if d.named]
    said = [1 - d.mistaken for _, d in named]
    line("answers with a name whose first set holds a true cause", [holds_first(r, d) for r, d in named], said)
    caused = [(r, d) for r, d in done if r.stratum != "none" and d.verdict not in ("no_gap", "unfinished")]
    line("answers to a gap with a cause that hold what is true", [holds(r, d) for r, d in caused], [0.9])
    outside = [(r, d) for r, d in caused if r.stratum in OUTSIDE]
    line("of these, causes of no candidate: none of these is in the answer", [holds(r, d) for r, d in outside])
    for low, high in BINS:
        foremost = [(max(d.probabilities, key=d.probabilities.__getitem__), r, d) for r, d in done if d.probabilities]
        some = [(name, r, d) for name, r, d in foremost if low <= d.probabilities[name] < high + (high == 1)]
        said = [d.probabilities[name] for name, _, d in some]
        line(f"the foremost candidate is true, where said {low:g} to {high:g}", [n in r.true for n, r, _ in some], said)
    for low, high in BINS:
        some = [(r, d) for r, d in done if low <= d.nothing < high + (high == 1)]
        what = f"there is no cause, where said {low:g} to {high:g}"
        line(what, [r.stratum == "none" for r, _ in some], [d.nothing for _, d in some])


def holds_first(row: Row, done: Decision) -> bool:
    return any(name in row.true for name in done.sets[0])


def intervals(judged: Sequence[tuple[Row, Verdicts]]) -> None:
    right = [(row, by) for row, by in judged if {*row.evidence.chosen} == {*row.true} and row.stratum not in OUTSIDE]
    errors = [np.array(row.errors).T for row, _ in right]
    doubted = [doubted_sd(sd, by.doubt) for (_, sd), (_, by) in zip(errors, right, strict=True)]
    covers = np.abs([error for error, _ in errors]) <= HALF_WIDTH * np.array(doubted)
    drawn = np.random.default_rng(0).integers(len(right), size=(2000, len(right)))
    low, high = np.quantile(covers[drawn].mean(axis=(1, 2)), [0.025, 0.975])
    what = "90 % intervals of parameters that cover, where the cause was found"
    print(
        f"| {what} | {covers.sum()} of {covers.size} ({covers.mean():.0%}, {100 * low:.0f} to {100 * high:.0f}) | 90% |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("farm", type=Path, help="folder of `diagnosis farm`")
    parser.add_argument("--verdict", type=Path, help="a verdict that was calibrated by another farm")
    asked = parser.parse_args()
    paths = sorted((asked.farm / "rows").glob("*.json"), key=lambda path: int(path.stem))
    rows = [read_row(read_json(path, RecordingError, "a row of a farm")) for path in paths]
    found = Rows(read_json(asked.farm / "about.json", RecordingError, "what a farm is of"), tuple(rows))
    strata = [row.stratum for row in rows]
    print(f"{len(rows)} recordings:", ", ".join(f"{strata.count(one)} {one}" for one in dict.fromkeys(strata)))
    cpu = [row.cpu_seconds for row in rows]
    print(f"processor time {np.median(cpu):.0f} s in the median, {max(cpu):.0f} s at most\n")
    print("| figure | value | said |\n|---|---|---|")
    judged = [(row, read_verdicts(asked.verdict)) for row in rows] if asked.verdict else apart(found)
    answers([(row, decide(row.evidence, by)) for row, by in judged])
    intervals(judged)


if __name__ == "__main__":
    main()
