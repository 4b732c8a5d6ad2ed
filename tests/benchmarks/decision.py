"""What the constants of a diagnosis' decision are frequencies of, in opened blind sets.

Prints, over all sets given and apart for simulated and replayed actuators: the share of the gap left about which
rejected best fits cease to hold a true cause (HALF, with STEEP, by maximum likelihood), and how often what is named
holds none though the best fit is not rejected (LEAST). Of what holds none the share of causes outside the library
and of no gap at all (OUTSIDE, AFTER_ALL), of two effects that are named and not both mistaken how often each is a cause
(BESIDE; recordings as they are), how often there is no gap where none was found (NOTHING), of the other such
recordings the share of causes outside (UNSEEN_OUTSIDE), and what evidences are best divided by (TEMPER), so that the
probabilities are most likely to hold the truth where one effect was found. Strata are weighted as ``blind make`` draws
them, but for HALF. A set that takes part is not to be reported afterwards.

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
from diagnosis.gap.decision import AFTER_ALL, BESIDE, HALF, LEAST, NOTHING, OUTSIDE, STEEP, UNSEEN_OUTSIDE
from diagnosis.gap.weighing import TEMPER

WEIGHTS = {"none": 4, "library": 5, "form": 5, "outside": 4}
WIDE = 1.0
"""Prior standard deviation of log STEEP about USUAL: few recordings are near the middle."""
USUAL = 0.15
ANOTHER = (1 - OUTSIDE - AFTER_ALL) * LEAST[False]
"""How probable another candidate is than those that the evidence points to, whatever evidences are divided by."""
TINY = 1e-9
"""Probability below which it is all one."""


def share_left(verdict: Verdict) -> float:
    """As :attr:`diagnosis.gap.searched.Search.share_left`."""
    left = verdict.left_over
    return float(np.clip(left[-1] / left[0], 0, 1)) if left[0] > 1 else 0.0


def even(ones: list[tuple[float, bool, bool]]) -> tuple[float, float]:
    """HALF and STEEP of rejected fits (share left, mistaken, replayed), by the curve of :func:`.mistaken_by`."""
    share, wrong, replayed = np.array(ones, dtype=float).reshape(-1, 3).T
    least = np.where(replayed > 0, LEAST[True], LEAST[False])

    def loss(x: np.ndarray) -> float:
        chance = least + (1 - least) * expit((share - x[0]) / np.exp(x[1]))
        chance = np.clip(chance, TINY, 1 - TINY)
        likely = np.where(wrong > 0, np.log(chance), np.log(1 - chance)).sum()
        return float(-likely + 0.5 * ((x[1] - np.log(USUAL)) / WIDE) ** 2)

    found = minimize(loss, [0.3, np.log(USUAL)], method="Nelder-Mead", options={"maxiter": 2000}).x
    return float(found[0]), float(np.exp(found[1]))


def temper(found: list[tuple[float, np.ndarray]], divided: float) -> float:
    """What evidences are best divided by: maximum likelihood, from probabilities of the true candidate and of all.

    ``divided``: by what the evidences behind these probabilities were.
    """

    def loss(log: float) -> float:
        power = divided / np.exp(log)
        chances = [true**power / np.sum(each**power) for true, each in found]
        return -sum(
            np.log((1 - ANOTHER) * chance + ANOTHER / len(each))
            for chance, (_, each) in zip(chances, found, strict=True)
        )

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
    wrong: dict[str, int] = defaultdict(int)
    pairs: list[list[bool]] = []
    for one in given.sets:
        folder, answers, results = one.split(",")
        rows = side_by_side(open_answers(Path(folder), Path(answers)), results, read_run(results))
        for row in rows:
            verdict, stratum = row.outcome.verdict, row.stratum
            if verdict is not None and len(verdict.sets) == 2 and verdict.named:
                pairs.append([bool(set(row.effects) & set(one)) for one in verdict.sets])
            if verdict is None or stratum == "two":
                continue
            quiet[stratum].append(verdict.verdict == "no_gap")
            if verdict.verdict == "no_gap":
                continue
            if hidden(row, verdict):
                wrong[stratum] += 1
            if row.single and len(verdict.sets) == 1 and row.effects[0] in verdict.probabilities:
                whole = sum(verdict.pointed.values())
                chances = {name: max(p / whole, TINY) for name, p in verdict.pointed.items()}
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
    lines: list[tuple[str, float, float, int]] = []
    for kind in (None, False, True):
        said = {None: "", False: ", simulated", True: ", replayed"}[kind]
        ones = [one for one in rejected if kind is None or one[2] is kind]
        if ones:
            half, steep = even(ones)
            lines += [(f"HALF{said}", half, HALF, len(ones)), (f"STEEP{said}", steep, STEEP, len(ones))]
        fits = [(each[stratum], other) for stratum, other, replayed in kept if kind is None or replayed is kind]
        share = sum(weight for weight, other in fits if other) / max(sum(weight for weight, _ in fits), TINY)
        lines.append((f"LEAST{said}", share, np.nan if kind is None else LEAST[kind], len(fits)))
    mistakes = {name: each[name] * count for name, count in wrong.items()}
    for name, stratum, used_ in (("OUTSIDE", "outside", OUTSIDE), ("AFTER_ALL", "none", AFTER_ALL)):
        lines.append((name, mistakes.get(stratum, 0.0) / sum(mistakes.values()), used_, sum(wrong.values())))
    held = [one for pair in pairs if any(pair) for one in pair]
    lines.append(("BESIDE", float(np.mean(held)) if held else np.nan, BESIDE, len(held) // 2))
    calm = {name: each[name] * sum(values) for name, values in quiet.items()}
    lines.append(("NOTHING", calm["none"] / silent, NOTHING, sum(map(sum, quiet.values()))))
    unseen = silent - calm["none"]
    count = sum(sum(values) for name, values in quiet.items() if name != "none")
    lines.append(("UNSEEN_OUTSIDE", calm["outside"] / unseen, UNSEEN_OUTSIDE, count))
    lines.append(("TEMPER", temper(weighed, given.temper), TEMPER, len(weighed)))
    print(f"{'constant':16s} {'found':>8s} {'used':>8s} {'recordings':>11s}")
    for name, value, used_, count in lines:
        print(f"{name:16s} {value:8.3f} {used_:8.3f} {count:11d}")
    print(json.dumps({name: f"{sum(values)} of {len(values)} quiet" for name, values in quiet.items()}))


def hidden(row: Row, verdict: Verdict) -> bool:
    """Whether what was named holds no true cause; of an answer that names none, whether the foremost is none."""
    likely = verdict.named or [verdict.foremost]
    return not set(row.effects) & set(likely)


if __name__ == "__main__":
    main()
