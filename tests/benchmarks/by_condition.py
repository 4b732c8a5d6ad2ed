"""The answers of a blind check by condition, how often each effect that was named first was a cause, and sizes.

How many effects answers name, and how often as many drawn at random would hold a true cause. Intervals of shares are
95 %.

Of answers of ``none_of_these`` whose cause was in the library after all: how often the candidate nearest to the gap was
it. Sizes are those of effects of the library, acting by its own law, that were rightly named, alone or as one of two.

Run, on an opened set: ``python tests/benchmarks/by_condition.py SET ANSWERS VERDICTS [--first N]``.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np

from diagnosis.blind import rates
from diagnosis.blind.opened import Row, side_by_side
from diagnosis.blind.rates import names, share
from diagnosis.blind.score_report import NAMED, by_chance, by_size, either, lengths, percent
from diagnosis.blind.sealed import open_answers
from diagnosis.blind.verdicts import read_run


def condition(one: Row) -> tuple[str, str]:
    """Actuators and persons."""
    return ("replayed" if one.answer["replay"] else "simulated"), one.answer["occupancy"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("set", type=Path)
    parser.add_argument("answers", type=Path)
    parser.add_argument("verdicts", type=Path)
    parser.add_argument("--first", type=int, help="so many recordings only, of a run that was stopped")
    options = parser.parse_args()
    opened = open_answers(options.set, options.answers)
    pairs = side_by_side(opened, options.verdicts, read_run(options.verdicts), options.first)
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for one in pairs:
        groups[condition(one)].append(one)
        groups[condition(one)[0], "all"].append(one)
    print("| controllers | persons | false alarms | a true cause is in the answer | if as many were drawn at random |")
    print("|---|---|---|---|---|")
    for (controllers, persons), some in sorted(groups.items()):
        quiet = [one for one in some if one.stratum == "none"]
        alarms = percent(share([one.outcome.answer != "no_gap" for one in quiet]))
        right = names(some).by_size[0]
        print(f"| {controllers} | {persons} | {alarms} | {percent(right.held)} | {by_chance(right.chance)} |")
    found = names(pairs)
    print(f"\n{lengths(found)}\n\n| {' | '.join(NAMED)} |\n|---|---|---|")
    for line in by_size(found):
        print(f"| {' | '.join(line)} |")
    print("\n| controllers | named first | was a cause |\n|---|---|---|")
    first: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for one in pairs:
        if one.named:
            first[condition(one)[0], one.best].append(one.top)
    for (controllers, name), hits in sorted(first.items(), key=lambda item: -len(item[1])):
        print(f"| {controllers} | {name} | {percent(share(hits))} |")
    near = [nearest(one) in one.effects for one in pairs if one.outcome.answer == "none_of_these" and one.single]
    print(f"\nnone_of_these of a cause in the library: the nearest was it in {percent(share(near))}")
    spent = [one.outcome.cpu_seconds for one in pairs if one.outcome.cpu_seconds is not None]
    if spent:  # programs of earlier versions did not note it
        median, most, longest = np.quantile(spent, [0.5, 0.9, 1.0], method="higher")
        print(f"processor time [s]: median {median:.0f}, of nine in ten at most {most:.0f}, longest {longest:.0f}")
    held = rates.sizes(pairs)
    print(f"90 % intervals that hold the truth, {held.what}: {either(held.held)}")
    print(
        "\n| recording | controllers | persons | effect | true | told | 90 % interval |\n|---|---|---|---|---|---|---|"
    )
    for one in pairs:
        verdict = one.outcome.verdict
        if verdict is None or one.stratum not in ("library", "two"):
            continue
        true = one.true_sizes
        for name in sorted(set(verdict.sizes) & set(true)):
            size = verdict.sizes[name]
            print(
                f"| {Path(one.outcome.file).stem} | {' | '.join(condition(one))} | {name} | {true[name]:.3g} "
                f"| {size.value:.3g} | {size.low:.3g} to {size.high:.3g} |"
            )


def nearest(one: Row) -> str:
    """The candidate that a report calls nearest: the first that was fitted in the end; empty where none was."""
    verdict = one.outcome.verdict
    return verdict.chosen[0] if verdict is not None and verdict.chosen else ""


if __name__ == "__main__":
    main()
