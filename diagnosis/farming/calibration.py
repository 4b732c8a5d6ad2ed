"""A verdict calibrated by a farm's rows: the weights of its probabilities, and the limits of its answers.

Weights are the most plausible of a conditional logit with a wide normal prior. What a set holds is conformal (Vovk
2012, ACML 25:475) among answers to gaps that have a cause, of probabilities that weights without the recording's own
tenth gave (cross-conformal: the level is held about, not exactly). How many recordings without a cause are answered by
a gap is counted, not held. What is told of answers is of weights and limits that are of the other nine tenths.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from diagnosis.blind.scored import binned
from diagnosis.farming.rows import Row, Rows
from diagnosis.gap.verdict import LIKELY, Decision, Probabilities, condition, decide, features, probabilities
from diagnosis.usual import HALF_WIDTH
from diagnosis.usual import LEVEL as COVER
from diagnosis.verdicts import NONE, NOTHING, POOLED, Answers, Count, Verdicts
from shared.errors import RecordingError

FOLDS = 10
WIDE = 2.0
"""Standard deviation of a weight in its prior."""
POWER = (1 / 3, 1.0)
"""Median of the evidence's power in its prior, and the standard deviation of its logarithm."""
FEWEST = 25
"""Recordings without a cause by which weights are fitted."""
OWN = 100
"""Answers of a condition that has a limit of its own: of fewer, two that miss make a limit that lets all in."""
OUTSIDE = ("outside", "withheld")
"""Strata whose cause is no candidate."""


def calibrated(found: Rows) -> Verdicts:
    """A verdict from a farm's rows.

    Raises
    ------
    RecordingError
        If there are too few.
    """
    return _calibrated(found)[0]


def apart(found: Rows) -> list[tuple[Row, Verdicts]]:
    """A farm's rows, each with weights, limits and doubt that are of the other nine tenths; as :func:`calibrated`."""
    rest = [[row for k, row in enumerate(found.rows) if k % FOLDS != fold] for fold in range(FOLDS)]
    doubts = [_doubt(some) for some in rest]
    return [
        (row, by.model_copy(update={"doubt": doubts[k % FOLDS]})) for k, (row, by) in enumerate(_calibrated(found)[1])
    ]


def _calibrated(found: Rows) -> tuple[Verdicts, list[tuple[Row, Verdicts]]]:
    """The verdict, and the rows with those whose weights and limits are of the other nine tenths."""
    rows = found.rows
    nulls = sum(row.stratum == "none" for row in rows)
    if nulls < FEWEST or nulls == len(rows):
        raise RecordingError(
            f"{len(rows)} recordings, {nulls} of them without a cause; expected at least {FEWEST} of these and"
            " some with one. The rows are kept: ask for more --recordings"
        )
    places = np.arange(len(rows)) % FOLDS
    of_others = [
        fitted([row for row, place in zip(rows, places, strict=True) if place != fold]) for fold in range(FOLDS)
    ]
    chances = [_by(of_others[place], row) for place, row in zip(places, rows, strict=True)]
    about = {name: found.about[name] for name in Verdicts.model_fields if name in found.about}
    nothing = Count(what="", low=0, high=1, count=0, said=0, true=0)
    whole = Verdicts(
        **about,
        made=datetime.now(UTC).strftime("%Y-%m-%d"),
        strata=dict(Counter(row.stratum for row in rows)),
        **_named(fitted(rows)),
        **_limits(rows, chances),
        cover=COVER,
        doubt=_doubt(rows),
        reliability=_reliability(chances, rows),
        answers=Answers(alarms=nothing, named=nothing, outside=nothing),
    )
    by_fold = []
    for fold in range(FOLDS):
        rest = [k for k, place in enumerate(places) if place != fold]
        limits = _limits([rows[k] for k in rest], [chances[k] for k in rest])
        by_fold.append(whole.model_copy(update=_named(of_others[fold]) | limits))
    judged = [(row, by_fold[place]) for row, place in zip(rows, places, strict=True)]
    answers = _answers([(row, decide(row.evidence, by)) for row, by in judged])
    return whole.model_copy(update={"answers": answers}), judged


def _limits(rows: Sequence[Row], apart: Sequence[Probabilities]) -> dict[str, Any]:
    """Limits of an answer: of all, and of a condition where there are enough recordings of it."""
    pairs = list(zip(rows, apart, strict=True))
    conditions = {condition(row.evidence) for row in rows}
    held = {}
    for name in [POOLED, *sorted(conditions)]:
        some = [
            (row, chance)
            for row, chance in pairs
            if name in (POOLED, condition(row.evidence)) and row.stratum != "none"
            if row.evidence.gap and row.evidence.chosen and chance.nothing < LIKELY
        ]
        right = [_in_set(chance, row) for row, chance in some]
        if name == POOLED or len(right) >= OWN:
            held[name] = _lowest(right, 1 - COVER)
    return {"held": held, "second": _second(rows)}


def fitted(rows: Sequence[Row]) -> np.ndarray:
    """The most plausible weights: logarithm of the power, those of no gap, those of none of these."""
    nothing, none, behind, true = _tables(rows)
    known = np.isfinite(behind)
    lost = np.where(known, behind, 0.0)
    spread = np.concatenate([[POWER[1]], np.full(len(NOTHING) + len(NONE), WIDE)])
    middle = np.concatenate([[np.log(POWER[0])], np.zeros(len(NOTHING) + len(NONE))])

    def cost(weights: np.ndarray) -> tuple[float, np.ndarray]:
        power = np.exp(weights[0])
        own = weights[1 : 1 + len(NOTHING)], weights[1 + len(NOTHING) :]
        odds = np.column_stack([nothing @ own[0], none @ own[1], np.where(known, power * lost, -np.inf)])
        right = np.where(true, odds, -np.inf)
        all_, of_true = logsumexp(odds, axis=1), logsumexp(right, axis=1)
        less = np.exp(odds - all_[:, None]) - np.exp(right - of_true[:, None])
        slope = np.concatenate([[power * np.sum(less[:, 2:] * lost)], less[:, 0] @ nothing, less[:, 1] @ none])
        off = (weights - middle) / spread
        return float(np.sum(all_ - of_true) + 0.5 * off @ off), slope + off / spread

    return np.asarray(minimize(cost, middle, jac=True, method="L-BFGS-B").x)


def _tables(rows: Sequence[Row]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Features of no gap and of none of these (rows, features), how far candidates are behind, and what is true.

    The third (rows, candidates) is -inf where there is no candidate; the fourth (rows, 2 + candidates) has no gap and
    none of these first.
    """
    most = max(len(row.evidence.candidates) for row in rows)
    behind, true = np.full((len(rows), most), -np.inf), np.zeros((len(rows), 2 + most), dtype=bool)
    for k, row in enumerate(rows):
        names = [*row.evidence.candidates]
        values = np.array([*row.evidence.candidates.values()])
        behind[k, : len(names)] = values - values.max(initial=-np.inf)
        right = [name in row.true for name in names]
        if not any(right) and any(name in row.evidence.beside for name in row.true):
            right = [True] * len(names)  # found as a second effect: the first is one of these, no matter which
        outside = row.stratum != "none" and not any(right)  # a candidate that was not tried is none
        true[k, : 2 + len(names)] = [row.stratum == "none", outside, *right]
    known = [features(row.evidence) for row in rows]
    nothing, none = (np.array([[one[name] for name in names] for one in known]) for names in (NOTHING, NONE))
    return nothing, none, behind, true


def _named(weights: np.ndarray) -> dict[str, Any]:
    """Weights by the names that a verdict has for them."""
    nothing = dict(zip(NOTHING, weights[1 : 1 + len(NOTHING)].tolist(), strict=True))
    none = dict(zip(NONE, weights[1 + len(NOTHING) :].tolist(), strict=True))
    return {"nothing": nothing, "none": none, "power": float(np.exp(weights[0]))}


def _by(weights: np.ndarray, row: Row) -> Probabilities:
    return probabilities(row.evidence, **_named(weights))


def _in_set(chance: Probabilities, row: Row) -> float:
    """The limit up to which what is true is in one of the sets: where two causes are, one of them."""
    tried = [some[name] for some in (chance.causes, chance.beside) for name in row.true if name in some]
    return max(tried) if tried else chance.none  # a candidate that was not tried is none


def _lowest(values: Sequence[float], share: float) -> float:
    """The value below which a new one of the same kind lies with a probability of ``share`` at most."""
    rank = int(np.floor(share * (len(values) + 1)))
    return float(np.sort(values)[rank - 1]) if rank else 0.0


def _doubt(rows: Sequence[Row]) -> float:
    """How much fits are to be doubted, so that their intervals cover in a share COVER where the cause was found.

    An interval reaches a true value if the doubt is so large that the prior's and the recording's information together
    are small enough; one beyond the prior's own interval it never reaches.

    Raises
    ------
    RecordingError
        If no doubt makes that many cover.
    """
    found = [row.errors for row in rows if {*row.evidence.chosen} == {*row.true} and row.stratum not in OUTSIDE]
    error, sd = np.array([one for errors in found for one in errors]).reshape(-1, 2).T
    told = np.maximum(sd**-2.0 - 1, 0)
    room = (HALF_WIDTH / np.maximum(np.abs(error), 1e-9)) ** 2 - 1
    needed = np.where(room > 0, np.sqrt(told / np.maximum(room, 1e-12)), np.inf)
    rank = int(np.ceil(COVER * len(needed)))
    doubt = float(np.sort(needed)[rank - 1]) if len(needed) else np.inf
    if not np.isfinite(doubt):
        raise RecordingError(
            f"{len(found)} recordings whose cause was found, and more than {1 - COVER:.0%} of their parameters are"
            " beyond the ranges of the description; expected true values within them"
        )
    return max(doubt, 1.0)


def _second(rows: Sequence[Row]) -> float:
    """How often a second effect that was chosen is a cause beside the first, drawn to a half by two recordings."""
    right = [row.evidence.chosen[1] in row.true for row in rows if len(row.evidence.chosen) > 1]
    return (sum(right) + 1) / (len(right) + 2)


def _reliability(apart: Sequence[Probabilities], rows: Sequence[Row]) -> list[Count]:
    """What was said and what was true, by bins of what was said."""
    said: dict[str, list[tuple[float, bool]]] = {"no gap": [], "none of these": [], "the foremost candidate": []}
    for chance, row in zip(apart, rows, strict=True):
        said["no gap"].append((chance.nothing, row.stratum == "none"))
        said["none of these"].append((chance.none, row.stratum in OUTSIDE))
        if chance.causes:
            name = max(chance.causes, key=lambda one: chance.causes[one])
            said["the foremost candidate"].append((chance.causes[name], name in row.true))
    return [_count(what, some, true, low, high) for what, low, high, some, true in binned(said)]


def _answers(done: Sequence[tuple[Row, Decision]]) -> Answers:
    """What answers were worth."""
    alarms, named, outside = [], [], []
    for row, decision in done:
        if row.stratum == "none":
            alarms.append(decision.verdict != "no_gap")
        if decision.verdict in ("effect", "ambiguous"):
            named.append((1 - decision.mistaken, any(name in row.true for name in decision.sets[0])))
        if row.stratum in OUTSIDE and decision.verdict != "no_gap":
            outside.append(decision.verdict == "none_of_these" or decision.or_none)
    return Answers(
        alarms=_count("recordings without a cause in which a gap is answered", [], alarms),
        named=_count(
            "answers whose first set holds a true cause", [one for one, _ in named], [one for _, one in named]
        ),
        outside=_count("gaps of no candidate of which that is in the answer", [], outside),
    )


def _count(what: str, said: Sequence[float], true: Sequence[bool], low: float = 0.0, high: float = 1.0) -> Count:
    return Count(
        what=what,
        low=low,
        high=high,
        count=len(true),
        said=float(np.mean(said)) if len(said) else 0.0,
        true=float(np.mean(true)) if len(true) else 0.0,
    )
