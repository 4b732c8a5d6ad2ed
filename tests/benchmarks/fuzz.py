"""Damaged files for every reader, many more than the tests try: a table of what came back.

Run: ``python tests/benchmarks/fuzz.py [--seconds 10] [--most 2000] [--seed 0] [--family shared datagen trainer
diagnosis] [--only NAME]``; the seconds are of processor time, for each reader. The exit code is 1 if
anything but a result or a sentence of this project came back: what a library says of its own trouble is none.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from importlib import import_module
from pathlib import Path

FAMILIES = ("shared", "datagen", "trainer", "diagnosis")


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--most", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--family", nargs="+", choices=FAMILIES, default=FAMILIES)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from tests.hostile.trial import read_whole, try_for

    bad = 0
    print("| reader | inputs tried | read all right | refused with a sentence | other | longest read [s] |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="zeroshot-fuzz-") as name:
        cases = [import_module(f"tests.hostile.cases_{family}") for family in options.family]
        for reader in (one for case in cases for one in case.readers(Path(name) / case.__name__)):
            if options.only not in reader.name:
                continue
            reader.own_words = True
            read_whole(reader)
            counts, other, longest = try_for(reader, options.seconds, options.seed, options.most)
            tried = counts["read"] + counts["refused"] + len(other)
            figures = f"{tried} | {counts['read']} | {counts['refused']} | {len(other)} | {longest:.2f}"
            print(f"| {reader.name} | {figures} |", flush=True)
            for line in other[:5]:
                print(f"  {reader.name}: {line}", file=sys.stderr)
            bad += len(other)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
