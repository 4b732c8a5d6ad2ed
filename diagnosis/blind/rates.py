"""How often verdicts are right: false alarms, recall, coverage, power, confusion, and what probabilities are worth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict

from diagnosis.blind.intervals import FEW, Figure, Share, figure, share, wilson
from diagnosis.blind.opened import WITHHELD, LeftOut, Row
from diagnosis.blind.verdicts import ANSWERS, FAILED

ORDER = ("none", "library", "form", "two", "outside", WITHHELD)
NONE, NOTHING = "none of these", "no gap"
SIZES = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Edges of bins of amplitudes over their scale; the outer ones are open."""
GAPS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, np.inf)
"""Edges of bins of the largest channel's sealed gap over noise."""
LENGTHS = (0.0, 4.0, 8.0, 16.0, 32.0, np.inf)
"""Edges of bins of the gap's length beyond what parameters and nuisance imitate."""
CHANCES = (0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
"""Edges of bins of probabilities."""
NOTICED = 0.01
"""Probabilities below are left out of the reliability of all statements: there would be nothing else."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Point(_Table):
    """A bin of a power curve: how often a gap was found, and how often the right effect was named first."""

    low: float
    high: float | None
    found: Share
    top: Share


class Bin(_Table):
    """A bin of a reliability diagram: the mean of what was said, and how often it was so."""

    low: float
    high: float
    said: float | None
    happened: Share


class Reliability(_Table):
    """What probabilities are worth.

    ``brier``: mean square error of the statements (Brier 1950, Mon. Weather Rev. 78:1); ``reference``: of always saying
    how often it happens; ``error``: mean distance of saying and happening over the bins, weighted by their numbers.
    """

    bins: list[Bin]
    brier: Figure
    reference: float | None
    error: Figure


class Matrix(_Table):
    """How often each row's truth was answered by each column."""

    rows: list[str]
    columns: list[str]
    counts: list[list[int]]


def strata_by_verdict(rows: Sequence[Row]) -> Matrix:
    """Stratum by verdict; recordings without a verdict in a column of their own."""
    strata = sorted({row.stratum for row in rows}, key=lambda name: (ORDER.index(name) if name in ORDER else 99, name))
    columns = [*ANSWERS, FAILED]
    counts = [[sum(r.stratum == s and r.outcome.answer == c for r in rows) for c in columns] for s in strata]
    return Matrix(rows=strata, columns=columns, counts=counts)


def effects_by_name(rows: Sequence[Row], library: Sequence[str]) -> Matrix:
    """True effect by the effect that is named first, for recordings of at most one cause; only what occurs."""
    order = {name: k for k, name in enumerate([*library, NONE, NOTHING, FAILED])}
    pairs: Counter[tuple[str, str]] = Counter()
    for row in rows:
        if row.truth == "effect" and not row.single:
            continue
        true = row.effects[0] if row.single else {"none_of_these": NONE, "no_gap": NOTHING}[row.truth]
        words = {"none_of_these": NONE, "no_gap": NOTHING, FAILED: FAILED}
        pairs[true, words.get(row.outcome.answer) or row.best or NONE] += 1
    first = sorted({true for true, _ in pairs}, key=lambda name: order.get(name, -1))
    second = sorted({named for _, named in pairs}, key=lambda name: order.get(name, -1))
    return Matrix(rows=first, columns=second, counts=[[pairs[a, b] for b in second] for a in first])


def power_by_size(rows: Sequence[Row]) -> list[Point]:
    """Against amplitude over scale, for recordings of one effect of the library."""
    single = [row for row in rows if row.single]
    return _power(single, np.array([row.size or 0.0 for row in single]), SIZES, closed=False)


def power_by_gap(rows: Sequence[Row]) -> list[Point]:
    """Against the sealed gap over noise of the channel where it is largest."""
    single = [row for row in rows if row.single]
    return _power(single, np.array([max(row.gap.values()) for row in single]), GAPS, closed=True)


def power_by_length(rows: Sequence[Row]) -> list[Point]:
    """Against the length of the gap that nothing known imitates; empty for a set without sealed lengths."""
    single = [row for row in rows if row.single and row.length is not None]
    return _power(single, np.array([row.length or 0.0 for row in single]), LENGTHS, closed=True) if single else []


def _power(rows: list[Row], size: np.ndarray, edges: Sequence[float], *, closed: bool) -> list[Point]:
    inner = np.asarray(edges if closed else edges[1:-1], dtype=float)
    place = np.digitize(size, inner) - (1 if closed else 0)
    points = []
    for k in range(len(edges) - 1):
        inside = [row for row, j in zip(rows, place, strict=True) if j == k]
        points.append(
            Point(
                low=edges[k],
                high=edges[k + 1] if np.isfinite(edges[k + 1]) else None,
                found=share([row.found for row in inside]),
                top=share([row.top for row in inside]),
            )
        )
    return points


def statements(row: Row) -> list[tuple[float, bool, str]]:
    """All that was said of one recording with a probability: how sure, whether it is so, and what was said."""
    verdict = row.outcome.verdict
    if verdict is None:
        return []
    said = [(p, name in row.effects, name) for name, p in verdict.probabilities.items()]
    if verdict.none is not None:
        said.append((verdict.none, row.truth == "none_of_these", NONE))
    if verdict.nothing is not None:
        said.append((verdict.nothing, row.truth == "no_gap", NOTHING))
    return said


def reliability_of_first(rows: Sequence[Row], seed: int = 0) -> Reliability:
    """Of what was said with the greatest probability; one statement for each recording."""
    firsts = [max(said, key=lambda one: one[0]) for row in rows if (said := statements(row))]
    return _reliability([[one[:2]] for one in firsts], seed)


def reliability_of_all(rows: Sequence[Row], seed: int = 0) -> Reliability:
    """Of all statements above :data:`NOTICED`."""
    return _reliability([[one[:2] for one in statements(row) if one[0] >= NOTICED] for row in rows], seed)


def brier_of_answers(rows: Sequence[Row], seed: int = 0) -> Figure:
    """Brier score over all answers together, 0 to 2, of recordings of at most one cause; 1 without a verdict."""
    scores = []
    for row in rows:
        if row.truth == "effect" and not row.single:
            continue
        said = statements(row)
        # what is true but was not among what was said had probability 0
        unsaid = 0.0 if any(true for _, true, _ in said) else 1.0
        scores.append(sum((p - true) ** 2 for p, true, _ in said) + unsaid)
    return figure(np.array(scores), seed=seed)


def _ratio(totals: np.ndarray, over: int, under: int) -> np.ndarray:
    """Ratio of two columns of sums (draws, columns); NaN where the second is zero."""
    below = totals[:, under]
    return np.where(below > 0, totals[:, over] / np.maximum(below, 1.0), np.nan)


def _reliability(said: list[list[tuple[float, bool]]], seed: int) -> Reliability:
    """Bins of statements that come in groups, one for each recording; groups are drawn in the bootstrap."""
    flat = np.array([one for group in said for one in group], dtype=float).reshape(-1, 2)
    place = np.clip(np.digitize(flat[:, 0], CHANCES) - 1, 0, len(CHANCES) - 2)
    # per recording: by bin the number, the sum of what was said and of what happened; and the squared errors
    count = len(CHANCES) - 1
    sums = np.zeros((len(said), 3 * count + 1))
    start = 0
    for i, group in enumerate(said):
        for j in range(start, start + len(group)):
            p, true = flat[j]
            sums[i, [place[j], count + place[j], 2 * count + place[j]]] += [1.0, p, true]
            sums[i, -1] += (p - true) ** 2
        start += len(group)

    def happened(k: int) -> Share:
        """Of several statements of one recording the recordings are drawn, not the statements.

        Where few made one, or all drawings are alike, it is at least Wilson's interval of so many recordings: what
        never happened in them could still happen.
        """
        found = share(flat[place == k, 1] > 0.5)
        if not found.n or max(len(group) for group in said) <= 1:
            return found
        drawn = figure(sums, lambda rows: _ratio(rows.sum(axis=1), 2 * count + k, k), seed=seed)
        own = int(np.count_nonzero(sums[:, k]))
        ends = [] if drawn.low is None or drawn.high is None else [drawn.low, drawn.high]
        if own < FEW or len(set(ends)) < 2:
            ends += wilson(found.hits / found.n, own)
        return found.model_copy(update={"low": min(ends), "high": max(ends)})

    bins = [
        Bin(
            low=CHANCES[k],
            high=CHANCES[k + 1],
            said=float(flat[place == k, 0].mean()) if (place == k).any() else None,
            happened=happened(k),
        )
        for k in range(count)
    ]

    def brier(rows: np.ndarray) -> np.ndarray:
        return np.asarray(rows[:, :, -1].sum(axis=1) / np.maximum(rows[:, :, :count].sum(axis=(1, 2)), 1.0))

    def error(rows: np.ndarray) -> np.ndarray:
        total = rows.sum(axis=1)
        apart = np.abs(total[:, count : 2 * count] - total[:, 2 * count : 3 * count]).sum(axis=1)
        return np.asarray(apart / np.maximum(total[:, :count].sum(axis=1), 1.0))

    rate = float(flat[:, 1].mean()) if len(flat) else None
    return Reliability(
        bins=bins,
        brier=figure(sums, brier, seed=seed),
        reference=None if rate is None else rate * (1 - rate),
        error=figure(sums, error, seed=seed),
    )


class LeftOutScore(_Table):
    """Leave-one-out: answers without the effect that is true.

    ``none``: none of these; ``none_or_alike``: that, or only effects that were declared to be confusable with it;
    ``quiet``: no gap; ``again``: how many were diagnosed again (in the others the true effect had had no chance, so
    that their verdicts stand); ``failed``: how many have no verdict, the first or that without the effect, and count as
    wrong answers; None in files of schema 8 and before, which do not say.
    """

    n: int
    again: int
    failed: int | None = None
    none: Share
    none_or_alike: Share
    quiet: Share


def leave_one_out(ones: Sequence[LeftOut]) -> LeftOutScore:
    """Score the verdicts without the true effect."""
    return LeftOutScore(
        n=len(ones),
        again=sum(one.again for one in ones),
        failed=sum(one.outcome.verdict is None for one in ones),
        none=share([one.none for one in ones]),
        none_or_alike=share([one.none_or_alike for one in ones]),
        quiet=share([one.outcome.answer == "no_gap" for one in ones]),
    )
