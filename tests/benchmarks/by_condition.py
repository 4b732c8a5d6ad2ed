"""The answers of a blind check by condition, and how often each effect that was named first was a cause.

Run, on an opened set: ``python tests/benchmarks/by_condition.py SET ANSWERS VERDICTS``.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

from diagnosis.blind.opened import Row, side_by_side
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
    options = parser.parse_args()
    pairs = side_by_side(open_answers(options.set, options.answers), options.verdicts, read_run(options.verdicts))
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for one in pairs:
        groups[condition(one)].append(one)
        groups[condition(one)[0], "all"].append(one)
    print("| controllers | persons | false alarms | a true cause is in the answer |\n|---|---|---|---|")
    for (controllers, persons), some in sorted(groups.items()):
        quiet = [one for one in some if one.stratum == "none"]
        named = [one for one in some if one.named]
        right = sum(bool(set(one.named) & set(one.effects)) for one in named)
        alarms = f"{sum(one.found for one in quiet)} of {len(quiet)}"
        print(f"| {controllers} | {persons} | {alarms} | {right} of {len(named)} |")
    print("\n| controllers | named first | was a cause |\n|---|---|---|")
    first: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for one in pairs:
        if one.named:
            first[condition(one)[0], one.best].append(one.top)
    for (controllers, name), hits in sorted(first.items(), key=lambda item: -len(item[1])):
        print(f"| {controllers} | {name} | {sum(hits)} of {len(hits)} |")


if __name__ == "__main__":
    main()
