"""What the constants of a diagnosis' decision are frequencies of, in opened blind sets.

Prints, over all sets given and apart for simulated and replayed actuators: the share of the gap left about which
rejected best fits cease to hold a true cause (``half``, with STEEP, by maximum likelihood), how often what is named
holds none though the best fit is not rejected (``least``), how often there is no gap where none was found
(NOTHING), and what evidences are best divided by (TEMPER), so that the probabilities are most likely to hold the truth
where one effect was found. For ``least`` and NOTHING strata are weighted as ``blind make`` draws them. A set that takes
part is not to be reported afterwards.

Run: ``diagnosis blind make SET --seed S``, ``diagnosis blind run SYSTEM SET --out VERDICTS``, then
``python tests/benchmarks/decision.py SET,SET.answers.json,VERDICTS [...]``.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.special import expit

from diagnosis.blind.opened import Row, side_by_side
from diagnosis.blind.sealed import open_answers
from diagnosis.blind.verdicts import Verdict, read_run
from diagnosis.gap.decision import NOTHING, REPLAYED, SIMULATED, STEEP
from diagnosis.gap.weighing import TEMPER

WEIGHTS = {"none": 4, "library": 5, "form": 5, "outside": 4}
WIDE = 1.0
"""Prior standard deviation of log STEEP about USUAL: few recordings are near the middle."""
USUAL = 0.15
TINY = 1e-9
"""Probability below which it is all one."""


def share_left(verdict: Verdict) -> float:
    """As :attr:`diagnosis.gap.search.Search.share_left`."""
    left = verdict.left_over
    return float(np.clip(left[-1] / left[0], 0, 1)) if left[0] > 1 else 0.0


def even(share: np.ndarray, other: np.ndarray, replayed: np.ndarray) -> tuple[float, float, float]:
    """``half`` of simulated and of replayed actuators, and STEEP, by the curves of :meth:`.Frequencies.other`."""

    def loss(x: np.ndarray) -> float:
        least = np.where(replayed, REPLAYED.least, SIMULATED.least)
        chance = least + (1 - least) * expit((share - np.where(replayed, x[1], x[0])) / np.exp(x[2]))
        chance = np.clip(chance, TINY, 1 - TINY)
        likely = np.where(other, np.log(chance), np.log(1 - chance)).sum()
        return float(-likely + 0.5 * ((x[2] - np.log(USUAL)) / WIDE) ** 2)

    found = minimize(loss, [0.3, 0.3, np.log(USUAL)], method="Nelder-Mead", options={"maxiter": 2000}).x
    return float(found[0]), float(found[1]), float(np.exp(found[2]))


def temper(found: list[tuple[float, np.ndarray]], divided: float) -> float:
    """What evidences are best divided by: maximum likelihood, from probabilities of the true candidate and of all.

    ``divided``: by what the evidences behind these probabilities were.
    """

    def loss(log: float) -> float:
        power = divided / np.exp(log)
        return -sum(power * np.log(true) - np.log(np.sum(each**power)) for true, each in found)

    return float(np.exp(minimize_scalar(loss, bounds=(np.log(0.5), np.log(10.0)), method="bounded").x))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("sets", nargs="+", help="folder, answers and verdicts, with commas between")
    parser.add_argument("--temper", type=float, default=TEMPER, help="what the verdicts' evidences were divided by")
    given = parser.parse_args()
    rejected: list[tuple[float, bool, bool]] = []
    quiet: dict[str, list[bool]] = defaultdict(list)
    kept: list[tuple[str, bool, bool]] = []
    weighed: list[tuple[float, np.ndarray]] = []
    for one in given.sets:
        folder, answers, results = one.split(",")
        rows = side_by_side(open_answers(Path(folder), Path(answers)), results, read_run(results))
        for row in rows:
            verdict, stratum = row.outcome.verdict, row.stratum
            if verdict is None or stratum == "two":
                continue
            quiet[stratum].append(verdict.verdict == "no_gap")
            if verdict.verdict == "no_gap":
                continue
            if row.single and len(verdict.sets) == 1 and row.effects[0] in verdict.probabilities:
                chances = {name: max(p / (1 - verdict.none), TINY) for name, p in verdict.probabilities.items()}
                weighed.append((chances[row.effects[0]], np.array(list(chances.values()))))
            replayed, other = row.answer["replay"], hidden(row, verdict)
            if len(verdict.left_over) < 2:
                continue  # no candidate was good for anything
            if verdict.rejected:
                rejected.append((share_left(verdict), other, replayed))
            else:
                kept.append((stratum, other, replayed))
    each = {name: WEIGHTS[name] / len(values) for name, values in quiet.items()}
    silent = sum(each[name] * sum(values) for name, values in quiet.items())
    table = np.array(rejected, dtype=float).reshape(-1, 3)
    shares, others, replays = table[:, 0], table[:, 1] > 0, table[:, 2] > 0
    half, half_replayed, steep = even(shares, others, replays)
    lines = [
        ("half, simulated", half, SIMULATED.half, int(np.sum(~replays))),
        ("half, replayed", half_replayed, REPLAYED.half, int(np.sum(replays))),
        ("STEEP", steep, STEEP, len(shares)),
    ]
    for name, replayed, used in (("simulated", False, SIMULATED), ("replayed", True, REPLAYED)):
        ones = [(each[stratum], other) for stratum, other, kind in kept if kind == replayed]
        share = sum(weight for weight, other in ones if other) / max(sum(weight for weight, _ in ones), 1e-12)
        lines.append((f"least, {name}", share, used.least, len(ones)))
    lines.append(("NOTHING", each["none"] * sum(quiet["none"]) / silent, NOTHING, sum(map(sum, quiet.values()))))
    lines.append(("TEMPER", temper(weighed, given.temper), TEMPER, len(weighed)))
    print(f"{'constant':16s} {'found':>8s} {'used':>8s} {'recordings':>11s}")
    for name, value, used_, count in lines:
        print(f"{name:16s} {value:8.3f} {used_:8.3f} {count:11d}")
    print(json.dumps({name: f"{sum(values)} of {len(values)} quiet" for name, values in quiet.items()}))


def hidden(row: Row, verdict: Verdict) -> bool:
    """Whether what was named holds no true cause; of an answer that names none, whether the most probable is none."""
    likely = verdict.named or sorted(verdict.probabilities, key=lambda name: -verdict.probabilities[name])[:1]
    return not set(row.effects) & set(likely)


if __name__ == "__main__":
    main()
