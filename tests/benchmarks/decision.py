"""What the constants of a diagnosis' decision are frequencies of: blind sets made for the purpose, never reported ones.

Prints, over all sets given: the share of the gap left at which a rejected best fit is as likely to be another cause as
the right one (HALF, with STEEP, by maximum likelihood; withheld candidates count as other causes), how often the cause
is another one though the best fit is not rejected (UNREJECTED), and how often there is none where none was found
(NOTHING). Strata are weighted as ``blind make`` draws them.

Run: ``diagnosis blind make SET --seed S``, ``diagnosis blind run SYSTEM SET --out VERDICTS --leave-one-out``, then
``python tests/benchmarks/decision.py SET,SET.answers.json,VERDICTS [...]``.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from diagnosis.blind.opened import left_out, side_by_side
from diagnosis.blind.sealed import open_answers
from diagnosis.blind.verdicts import Verdict, read_run
from diagnosis.gap.decision import HALF, NOTHING, STEEP, UNREJECTED

WEIGHTS = {"none": 4, "library": 5, "form": 5, "outside": 4}
WIDE = 1.0
"""Prior standard deviation of log STEEP about the present value: few recordings are near the middle."""


def share_left(verdict: Verdict) -> float:
    """As :attr:`diagnosis.gap.search.Search.share_left`; everything where nothing was chosen."""
    left = verdict.left_over
    return float(np.clip(left[-1] / left[0], 0, 1)) if len(left) > 1 and left[0] > 1 else float(len(left) < 2)


def even(share: np.ndarray, other: np.ndarray) -> tuple[float, float]:
    """HALF and STEEP of a logistic curve through whether the cause is another one."""

    def loss(x: np.ndarray) -> float:
        z = (share - x[0]) / np.exp(x[1])
        return float(np.sum(np.logaddexp(0, np.where(other, -z, z))) + 0.5 * ((x[1] - np.log(STEEP)) / WIDE) ** 2)

    found = minimize(loss, [HALF, np.log(STEEP)], method="Nelder-Mead").x
    return float(found[0]), float(np.exp(found[1]))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("sets", nargs="+", help="folder, answers and verdicts, with commas between")
    shares, others = [], []
    quiet: dict[str, list[bool]] = defaultdict(list)
    kept: list[tuple[str, bool]] = []
    for one in parser.parse_args().sets:
        folder, answers, results = one.split(",")
        rows = side_by_side(open_answers(Path(folder), Path(answers)), results, read_run(results))
        seen = [(row.stratum, row.outcome.verdict, row.truth != "effect") for row in rows]
        seen += [("withheld", each.outcome.verdict, True) for each in left_out(rows, results) if each.again]
        for stratum, verdict, other in seen:
            if verdict is None or stratum == "two":
                continue
            if stratum != "withheld":
                quiet[stratum].append(verdict.verdict == "no_gap")
            if verdict.verdict == "no_gap" or stratum == "none":
                continue
            if verdict.rejected:
                shares.append(share_left(verdict))
                others.append(other)
            elif stratum != "withheld":
                kept.append((stratum, other))
    half, steep = even(np.array(shares), np.array(others))
    each = {name: WEIGHTS[name] / len(values) for name, values in quiet.items()}
    whole = sum(each[stratum] for stratum, _ in kept)
    silent = sum(each[name] * sum(values) for name, values in quiet.items())
    table = {
        "HALF": (half, HALF, len(shares)),
        "STEEP": (steep, STEEP, len(shares)),
        "UNREJECTED": (sum(each[name] for name, other in kept if other) / whole, UNREJECTED, len(kept)),
        "NOTHING": (each["none"] * sum(quiet["none"]) / silent, NOTHING, sum(map(sum, quiet.values()))),
    }
    print(f"{'constant':12s} {'found':>8s} {'used':>8s} {'recordings':>11s}")
    for name, (value, used, count) in table.items():
        print(f"{name:12s} {value:8.3f} {used:8.3f} {count:11d}")
    print(json.dumps({name: f"{sum(values)} of {len(values)} quiet" for name, values in quiet.items()}))


if __name__ == "__main__":
    main()
