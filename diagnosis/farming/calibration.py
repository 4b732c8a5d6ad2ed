"""A verdict calibrated by a farm's rows: the weights of its probabilities, and the limits of its answers.

Weights are the most plausible of a conditional logit with a wide normal prior. What is told of them, and the limits,
come of probabilities that weights without the recording's own tenth gave it (cross-fitting). The limits are split
conformal (Vovk 2012, ACML 25:475): by label for no gap, and among the alarms for what a set holds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from diagnosis.farming.rows import Row, Rows
from diagnosis.gap.verdict import NONE, NOTHING, Count, Probabilities, Verdicts, decide, features, probabilities
from shared.errors import RecordingError

FOLDS = 10
WIDE = 2.0
"""Standard deviation of a weight in its prior."""
POWER = (1 / 3, 1.0)
"""Median of the evidence's power in its prior, and the standard deviation of its logarithm."""
ALARMS = 0.04
"""Share of recordings without a cause in which a gap may be answered."""
COVER = 0.9
"""Share of alarms in which the answer's set holds what is true."""
FEWEST = 25
"""Recordings without a cause from which :data:`ALARMS` can be held: one of so many is that share."""
OUTSIDE = ("outside", "withheld")
"""Strata whose cause is no candidate."""
BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)


def calibrated(found: Rows) -> Verdicts:
    """A verdict from a farm's rows.

    Raises
    ------
    RecordingError
        If there are too few.
    """
    rows = found.rows
    nulls = [row for row in rows if row.stratum == "none"]
    if len(nulls) < FEWEST or len(nulls) == len(rows):
        raise RecordingError(
            f"{len(rows)} recordings, {len(nulls)} of them without a cause; expected at least {FEWEST} of these and"
            " some with one. The rows are kept: ask for more --recordings"
        )
    weights, folds = fitted(rows), _without_folds(rows)
    apart = [_by(other, row) for other, row in zip(folds, rows, strict=True)]
    alarm = _lowest([apart[k].nothing for k, row in enumerate(rows) if row.stratum == "none"], ALARMS)
    alarmed = [k for k, row in enumerate(rows) if row.evidence.gap and apart[k].nothing < alarm and row.evidence.chosen]
    of_true = [_of_true(apart[k], rows[k]) for k in alarmed if rows[k].stratum != "none"]
    about = {name: found.about[name] for name in Verdicts.model_fields if name in found.about}
    made = Verdicts(
        **about,
        made=datetime.now(UTC).strftime("%Y-%m-%d"),
        strata=dict(Counter(row.stratum for row in rows)),
        **_named(weights),
        second=_second(rows),
        alarm=alarm,
        alarms=max(ALARMS, 1 / (len(nulls) + 1)),
        held=_lowest(of_true, 1 - COVER),
        cover=COVER,
        reliability=_reliability(apart, rows),
        answers={},
    )
    return made.model_copy(update={"answers": _answers(made, folds, rows)})


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
        outside = row.stratum in OUTSIDE or (row.stratum != "none" and not any(right))
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


def _without_folds(rows: Sequence[Row]) -> list[np.ndarray]:
    """For each row the weights that are of the other folds."""
    places = np.arange(len(rows)) % FOLDS
    made = [fitted([row for row, place in zip(rows, places, strict=True) if place != fold]) for fold in range(FOLDS)]
    return [made[place] for place in places]


def _of_true(chance: Probabilities, row: Row) -> float:
    """Probability of what is true; of a process where candidates act, these are right answers, too."""
    if row.stratum == "none":
        return chance.nothing
    tried = [name for name in row.true if name in chance.causes]
    outside = chance.none if row.stratum in OUTSIDE or not tried else 0.0  # a candidate that was not tried is none
    return outside + sum(chance.causes[name] for name in tried)


def _lowest(values: Sequence[float], share: float) -> float:
    """The value below which a new one of the same kind lies with a probability of ``share`` at most."""
    rank = int(np.floor(share * (len(values) + 1)))
    return float(np.sort(values)[rank - 1]) if rank else 0.0


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
    found = []
    for what, pairs in said.items():
        p, true = np.array([one for one, _ in pairs]), np.array([one for _, one in pairs])
        for low, high in pairwise(BINS):
            some = (p >= low) & ((p < high) | (high == BINS[-1]))
            if some.any():
                found.append(_count(what, low, high, p[some].tolist(), true[some].tolist()))
    return found


def _answers(by: Verdicts, folds: Sequence[np.ndarray], rows: Sequence[Row]) -> dict[str, Count]:
    """What answers with this verdict's limits were worth, each by the weights of the other folds."""
    alarms, named, outside = [], [], []
    for row, weights in zip(rows, folds, strict=True):
        done = decide(row.evidence, by.model_copy(update=_named(weights)))
        if row.stratum == "none":
            alarms.append(done.verdict != "no_gap")
        elif done.verdict in ("effect", "ambiguous"):
            named.append((1 - done.mistaken, any(name in row.true for name in done.named)))
        if row.stratum in OUTSIDE and done.verdict != "no_gap":
            outside.append(done.verdict == "none_of_these" or any(name in row.true for name in done.named))
    return {
        "false alarms": _count("recordings without a cause in which a gap is answered", 0, 1, [by.alarms], alarms),
        "named": _count(
            "answers with a name that hold a true one", 0, 1, [one for one, _ in named], [one for _, one in named]
        ),
        "outside": _count("causes that are no candidate and are called so", 0, 1, [], outside),
    }


def _count(what: str, low: float, high: float, said: Sequence[float], true: Sequence[bool]) -> Count:
    return Count(
        what=what,
        low=low,
        high=high,
        count=len(true),
        said=float(np.mean(said)) if len(said) else 0.0,
        true=float(np.mean(true)) if len(true) else 0.0,
    )
