"""Damaged files for every reader, many more than the tests try: a table of what came back.

Run: ``python tests/benchmarks/fuzz.py [--seconds 10] [--most 2000] [--seed 0] [--family shared datagen trainer
diagnosis] [--only NAME] [--coverage]``; the seconds are of processor time, for each reader. The exit code is 1 if
anything but a result or a sentence of this project came back: what a library says of its own trouble is none.

With ``--coverage`` the damage is found by atheris (libFuzzer), which follows the branches of this project's own code;
it is no dependency of this project: ``pip install atheris``. Then one reader is tried, the one that ``--only`` names.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

FAMILIES = ("shared", "datagen", "trainer", "diagnosis")


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--most", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--family", nargs="+", choices=FAMILIES, default=FAMILIES)
    parser.add_argument("--only", default="")
    parser.add_argument("--coverage", action="store_true")
    options = parser.parse_args()
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    if options.coverage:
        return follow_branches(options)
    from tests.hostile.trial import read_whole, try_for

    bad = 0
    print("| reader | inputs tried | read all right | refused with a sentence | other | longest read [s] |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="zeroshot-fuzz-") as name:
        for reader in readers(Path(name), options.family):
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


def readers(folder: Path, families: Sequence[str]) -> list:
    """All readers of some families."""
    from importlib import import_module

    found = []
    for family in families:
        found += import_module(f"tests.hostile.cases_{family}").readers(folder / family)
    return found


def follow_branches(options: argparse.Namespace) -> int:
    """Let atheris look for damage to one reader's file."""
    import atheris

    with atheris.instrument_imports(include=list(FAMILIES)):
        from tests.hostile.trial import outcome_of

        folder = Path(tempfile.mkdtemp(prefix="zeroshot-fuzz-"))
        reader = next(one for one in readers(folder, options.family) if options.only in one.name)
        reader.own_words = True
    counts = {"read": 0, "refused": 0}
    (folder / "corpus").mkdir()
    (folder / "corpus" / "whole").write_bytes(reader.whole)

    def one_input(data: bytes) -> None:
        said = outcome_of(reader, data)
        if said not in counts:
            raise RuntimeError(said)
        counts[said] += 1
        if not sum(counts.values()) % 1000:
            print(f"{reader.name}: {counts}", flush=True)

    words = [sys.argv[0], f"-seed={options.seed or 1}", f"-max_total_time={options.seconds:.0f}", "-rss_limit_mb=8000"]
    atheris.Setup([*words, f"-max_len={4 * len(reader.whole)}", str(folder / "corpus")], one_input)
    atheris.Fuzz()  # ends the process
    return 0


if __name__ == "__main__":
    sys.exit(main())
