"""How often verdicts are right: false alarms, recall, coverage, power, confusion, and what probabilities are worth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from math import comb

import numpy as np
from pydantic import BaseModel, ConfigDict
from scipy.special import ndtri

from diagnosis.blind.opened import WITHHELD, LeftOut, Row
from diagnosis.blind.verdicts import ANSWERS, FAILED, Moved, Parameter
from diagnosis.usual import HALF_WIDTH
from shared import metrics

LEVEL = 0.95
DRAWS = 2000
FEW = 10
"""Of fewer recordings a bootstrap's interval is too narrow: what they do not hold is never drawn."""
Statistic = Callable[[np.ndarray], np.ndarray]


class Share(BaseModel):
    """``hits`` of ``n``, with the 95 % interval of Wilson (1927, J. Am. Stat. Assoc. 22:209); empty where n is 0."""

    model_config = ConfigDict(extra="forbid")
    hits: int
    n: int
    value: float | None
    low: float | None
    high: float | None


class Figure(BaseModel):
    """A statistic of ``n`` recordings with its 95 % percentile bootstrap interval; empty where n is 0.

    One recording says nothing of how others would be: its figure has no interval.
    """

    model_config = ConfigDict(extra="forbid")
    n: int
    value: float | None
    low: float | None
    high: float | None


def share(hits: Sequence[bool] | np.ndarray) -> Share:
    """The share of hits."""
    n, k = len(hits), int(np.sum(hits))
    if n == 0:
        return Share(hits=0, n=0, value=None, low=None, high=None)
    low, high = wilson(k / n, n)
    return Share(hits=k, n=n, value=k / n, low=low, high=high)


def wilson(value: float, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share of n."""
    low, high = metrics.wilson(value, n, float(ndtri((1 + LEVEL) / 2)))
    return float(low), float(high)


def mean(rows: np.ndarray) -> np.ndarray:
    """Mean over recordings, shape (draws,) of (draws, n)."""
    return np.asarray(rows.mean(axis=1))


def median(rows: np.ndarray) -> np.ndarray:
    """Median over recordings, shape (draws,) of (draws, n)."""
    return np.asarray(np.median(rows, axis=1))


def figure(values: np.ndarray, statistic: Statistic = mean, *, seed: int = 0, draws: int = DRAWS) -> Figure:
    """A statistic of rows, one for each recording, shape (n,) or (n, columns).

    Parameters
    ----------
    statistic
        Of many draws of rows with replacement at once: (draws, n[, columns]) to (draws,).
    """
    values = np.asarray(values, dtype=float)
    n = len(values)
    if n == 0:
        return Figure(n=0, value=None, low=None, high=None)
    value = float(statistic(values[None])[0])
    if n == 1:
        return Figure(n=1, value=value, low=None, high=None)
    drawn = statistic(values[np.random.default_rng(seed).integers(0, n, (draws, n))])
    low, high = np.nanquantile(drawn, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Figure(n=n, value=value, low=float(low), high=float(high))


NAMED: tuple[tuple[int, int | None], ...] = ((1, None), (1, 1), (2, 4), (5, None))
"""Least and largest number of names (None: without end) of answers that are counted together."""
MOST = 0.9


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Named(_Strict):
    """Of answers that name ``least`` to ``most`` effects: how often a true cause is among them.

    ``chance``: how often one would be, on average, if as many names were drawn at random from the candidates that could
    be named in that recording; nothing where it has no cause of the library.
    """

    least: int
    most: int | None
    held: Share
    chance: Figure


class Names(_Strict):
    """Of answers that name effects: how many they name, and how often rightly; the first of ``by_size`` is of all.

    ``nine_in_ten`` of the answers name at most so many.
    """

    median: Figure
    nine_in_ten: Figure
    largest: int | None
    by_size: list[Named]


def names(rows: Sequence[Row], seed: int = 0) -> Names:
    """Count the names of answers that name effects; the others do not count."""
    named = [row for row in rows if row.named]
    lengths = np.array([len(row.named) for row in named])
    return Names(
        median=figure(lengths, median, seed=seed),
        nine_in_ten=figure(lengths, _nine_in_ten, seed=seed),
        largest=max((len(row.named) for row in named), default=None),
        by_size=[_of_length(named, least, most, seed) for least, most in NAMED],
    )


def _nine_in_ten(drawn: np.ndarray) -> np.ndarray:
    return np.asarray(np.quantile(drawn, MOST, axis=1, method="higher"))


def _of_length(named: Sequence[Row], least: int, most: int | None, seed: int) -> Named:
    ones = [row for row in named if least <= len(row.named) <= (most or len(row.named))]
    return Named(
        least=least,
        most=most,
        held=share([bool(set(row.effects) & set(row.named)) for row in ones]),
        chance=figure(np.array([by_chance(row) for row in ones]), seed=seed),
    )


def by_chance(row: Row) -> float:
    """Probability that as many names as the answer has hold a true cause if they are drawn from all candidates."""
    verdict = row.outcome.verdict
    candidates = set(row.named) | (set(verdict.probabilities) if verdict is not None else set())
    wrong, count = len(candidates - set(row.effects)), len(row.named)
    return 1.0 - comb(wrong, count) / comb(len(candidates), count)


class Held(BaseModel):
    """Of the intervals of one kind.

    ``held`` by recording: of its intervals the share that holds the truth, averaged over recordings, which are the
    independent draws; where each has but one interval, a share of recordings as any other; ``error``: root mean square
    of the estimate's distance to the truth over the half-width of the side that the truth lies on, times 1.645 (1 for
    honest intervals of a normal posterior); ``by_parameter``: each parameter's share.
    """

    model_config = ConfigDict(extra="forbid")
    what: str
    held: Share | Figure
    error: Figure
    by_parameter: dict[str, Share] = {}


_BLUNT = 1e-12


def sizes(rows: Sequence[Row], seed: int = 0) -> Held:
    """Intervals of the size of an effect that was rightly named, as the candidate has it; of others it has none."""
    found = []
    for row in rows:
        verdict = row.outcome.verdict
        if verdict is None or row.stratum != "library":
            continue
        true = row.true_sizes
        of_row = [
            _place(one.value, one.low, one.high, true[name])
            for name, one in verdict.sizes.items()
            if name in row.effects and name in true
        ]
        if of_row:
            found.append(of_row)
    return _held("size of an effect of the library that was rightly named", found, seed=seed)


def parameters(rows: Sequence[Row], estimated: Sequence[Parameter], seed: int = 0) -> list[Held]:
    """Intervals of the parameters: as they are stated in the end, and by what the answer was worth."""
    named = [row for row in rows if row.named]
    right = [row for row in named if set(row.effects) & set(row.named)]
    wrong = [row for row in named if not set(row.effects) & set(row.named)]
    quiet = [row for row in rows if row.outcome.answer == "no_gap"]
    kinds: list[tuple[str, list[Row], bool]] = [
        ("no gap found, and no effect there", [row for row in quiet if row.truth == "no_gap"], False),
        ("no gap found, but a cause there", [row for row in quiet if row.truth != "no_gap"], False),
        ("a true cause in the answer, before what was chosen is added", right, False),
        ("a true cause in the answer, after what was chosen is added", right, True),
        ("the same, controllers simulated", [row for row in right if not row.answer["replay"]], True),
        ("the same, in replay", [row for row in right if row.answer["replay"]], True),
        ("the same, nothing but true causes added", [row for row in right if row.only_true_added], True),
        ("only wrong causes named, after they are added", wrong, True),
        ("none of these", [row for row in rows if row.outcome.answer == "none_of_these"], False),
    ]
    return [_parameters(f"parameters: {what}", ones, estimated, after, seed) for what, ones, after in kinds]


def _parameters(what: str, rows: Sequence[Row], estimated: Sequence[Parameter], after: bool, seed: int) -> Held:
    found = []
    for row in rows:
        moved = row.outcome.verdict.parameters if row.outcome.verdict is not None else {}
        ends = [_ends(moved[one.name], after) for one in estimated if one.name in moved]
        if len(ends) == len(estimated) and all(one is not None for one in ends):
            # distances on the parameter's own scale, in which its posterior is nearest to a normal one
            places = []
            for one, told in zip(estimated, ends, strict=True):
                assert told is not None
                value, low, high, true = np.array([*told, row.answer["parameters"][one.name]], dtype=float)
                scaled = np.log([value, low, high, true]) if one.scale == "log" else (value, low, high, true)
                places.append(_place(*map(float, scaled)))
            found.append(places)
    return _held(what, found, [one.name for one in estimated], seed)


def _ends(one: Moved, after: bool) -> tuple[float, float, float] | None:
    found = (one.after, one.after_low, one.after_high) if after else (one.before, one.before_low, one.before_high)
    value, low, high = found
    return None if value is None or low is None or high is None else (value, low, high)


def _place(value: float, low: float, high: float, true: float) -> tuple[bool, float]:
    """Whether an interval holds the truth, and how far off the estimate is in standard deviations of that side."""
    width = (high - value) if true > value else (value - low)
    return low <= true <= high, HALF_WIDTH * (true - value) / max(width, _BLUNT * max(abs(value), 1.0))


def _held(what: str, found: Sequence[Sequence[tuple[bool, float]]], names: Sequence[str] = (), seed: int = 0) -> Held:
    single = all(len(row) == 1 for row in found)
    held = np.array([np.mean([one for one, _ in row]) for row in found])
    square = np.array([np.mean([off**2 for _, off in row]) for row in found])
    return Held(
        what=what,
        held=share(held) if single else figure(held, seed=seed),
        error=figure(square, lambda drawn: np.sqrt(drawn.mean(axis=1)), seed=seed),
        by_parameter={name: share([row[k][0] for row in found]) for k, name in enumerate(names)} if found else {},
    )


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
