"""When the residual is different: change points and episodes, in mean and in scatter.

Every stretch of 1, 2, 4, ... days, and everything up to or from a point (a change point), is held against the rest
of the record: a scan over stretches (Arias-Castro, Donoho and Huo 2005, "Near-optimal detection of geometric objects
by fast multiscale methods") sees short episodes that a cumulative sum averages away. The threshold is the twins', so
the residual's own wandering counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from diagnosis.where.finding import Finding
from diagnosis.where.series import ALPHA, DAY, HOUR, MaxTest, Residuals, max_test

STATISTICS = ("mean", "variance")
GRID = 6 * HOUR
"""Beginnings and ends of stretches lie this far apart [s]."""
_SAME = 0.5
"""Stretches that share this part of the shorter one are the same."""
MOST_EDGES = 400
"""In how many parts a stretch is looked at more closely at most: their number squared is looked at."""
MOST = 5
"""Stretches that are named at most."""
_ROUNDS = 2
"""Times as many stretches are looked at as are named at most: of some nothing is said."""
REST = "than in the rest of the recording"
_SEEN = 0.5
"""A stretch and the rest must hold this share of their readings."""


@dataclass(frozen=True)
class EpisodeTest:
    """Result of :func:`scan_episodes`. The cells of ``test`` are laid out as (channels, statistics, stretches)."""

    test: MaxTest
    channels: list[int]
    spans: list[tuple[float, float]]
    findings: list[Finding]


def scan_episodes(residuals: Residuals) -> EpisodeTest:
    """Test every stretch's mean and variance against the rest of the record; one p-value for all.

    Of variances only larger ones count, as in cells: than the rest's, and than what the rest of recordings has usually.

    A finding is taken off the recording's residual before the next is looked for, against the twins' largest
    statistic of the first round.

    Returns
    -------
    EpisodeTest
        ``spans`` (first, last) [s] belong to ``findings``; their ``size`` is the difference to the rest of the record,
        without the stretches that were named before.
    """
    starts, stops = _stretches(residuals.step, len(residuals.time))
    channels = residuals.measured
    stack = residuals.stacked
    parts = np.stack([_parts(stack[:, k], starts, stops) for k in channels], axis=1)
    shape = (len(channels), len(STATISTICS), len(starts))
    scatter = np.broadcast_to(np.arange(len(STATISTICS))[:, None] == STATISTICS.index("variance"), shape)
    outside = np.where(scatter, np.median(parts[..., 1, :], axis=0), -np.inf)
    test = max_test(_apart(parts, outside).reshape(len(stack), -1), upper=scatter.ravel())
    usual, now = parts[1:].mean(axis=0), parts[0]
    left, rest = stack[0].copy(), np.ones(stack.shape[1:], bool)
    t, adjusted = test.t, test.adjusted
    found: list[Finding] = []
    spans: list[tuple[float, float]] = []
    open_ = np.ones(shape, bool)
    for _ in range(_ROUNDS * MOST):
        size = np.where(test.kept & (open_ & _is_odd(now, usual)).ravel() & (adjusted <= ALPHA), np.abs(t), -np.inf)
        if len(found) == MOST or not np.isfinite(size).any():
            break
        means = np.where(np.arange(size.size) // shape[2] % 2 == 0, size, -np.inf)
        top = int(np.argmax(means if np.isfinite(means).any() else size))
        c, s, e = (int(i) for i in np.unravel_index(top, shape))
        k, inside = channels[c], np.zeros(left.shape[1], bool)
        start, stop = _refined(left[k], int(starts[e]), int(stops[e]), STATISTICS[s])
        inside[start:stop] = True
        inner, outer = left[k, inside], left[k, ~inside]
        if STATISTICS[s] == "mean":
            amount = float(np.nanmean(inner) - np.nanmean(outer))
            left[k, inside] -= amount
        else:
            amount = float(np.nanstd(inner) - np.nanstd(outer))
            usual_share = min(np.nanstd(outer) / np.nanstd(inner), 1.0)  # scatter is taken off, and none is made
            left[k, inside] = np.nanmean(inner) + (inner - np.nanmean(inner)) * usual_share
        # the stretch that was tested and the one peeled differ at their edges: it is not to be found again
        shared = np.minimum(stops, stop) - np.maximum(starts, start)
        open_[c, s] &= shared < _SAME * np.minimum(stops - starts, stop - start)
        # nor in the other statistic, if it is nearly the same stretch: one place is named once
        open_[c] &= shared < _SAME * (np.maximum(stops, stop) - np.minimum(starts, start))
        rest[k] &= ~inside
        said = _against_rest(stack[0, k], inside, rest[k], STATISTICS[s])
        if said * amount > 0 and (said > 0 or STATISTICS[s] == "mean"):
            first, last = residuals.time[start] - residuals.step, residuals.time[stop - 1]
            found.append(_finding(residuals, k, STATISTICS[s], said, float(t[top]), float(adjusted[top]), first, last))
            spans.append((float(first), float(last)))
        now = np.stack([_parts(left[j][None], starts, stops)[0] for j in channels])
        t, adjusted = test.restudentise(_apart(now, outside).ravel())
    return EpisodeTest(test, channels, spans, found)


def _apart(parts: np.ndarray, outside: np.ndarray) -> np.ndarray:
    """Stretches (..., 2, stretches) less the rest, which is taken for no less than ``outside`` (..., stretches)."""
    return np.asarray(parts[..., 0, :] - np.maximum(parts[..., 1, :], outside))


def _against_rest(values: np.ndarray, inside: np.ndarray, rest: np.ndarray, statistic: str) -> float:
    """Mean or standard deviation of a stretch less that of the rest [unit]; 0 where the rest has no reading."""
    parts = [values[one & np.isfinite(values)] for one in (inside, rest)]
    if not all(len(one) for one in parts):
        return 0.0
    inner, outer = (float(one.mean() if statistic == "mean" else one.std()) for one in parts)
    return inner - outer


def _stretches(step: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Stretches of 1, 2, 4, ... days up to a third of the record, those up to and those from every change point."""
    apart, day = max(1, round(GRID / step)), max(2, round(DAY / step))
    pairs = []
    length = day
    while length <= steps // 3:
        pairs += [(start, start + length) for start in range(0, steps - length + 1, apart)]
        length *= 2
    for start in range(apart, steps, apart):
        if min(start, steps - start) >= day:
            pairs += [(0, start), (start, steps)]
    starts, stops = np.array(sorted(set(pairs)), dtype=int).reshape(-1, 2).T
    return starts, stops


def _is_odd(now: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Whether it is the stretch that departs from what twins show, rather than the rest, (channels, 2, stretches)."""
    apart = np.abs(now - usual)
    return apart[..., 0, :] >= apart[..., 1, :]


def _parts(values: np.ndarray, starts: np.ndarray, stops: np.ndarray) -> np.ndarray:
    """Means and cube-rooted variances, inside and outside each stretch, shape (rows, 2, 2, stretches)."""
    seen = np.isfinite(values)
    centre = np.where(seen, values, 0.0).sum(axis=1, keepdims=True) / np.maximum(seen.sum(axis=1, keepdims=True), 1)
    apart = np.where(seen, values - centre, 0.0)

    def sums(of: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        total = np.concatenate([np.zeros((len(of), 1)), np.cumsum(of, axis=1)], axis=1)
        inside = total[:, stops] - total[:, starts]
        return inside, total[:, -1:] - inside

    count, first, second = sums(seen.astype(float)), sums(apart), sums(apart**2)
    length = stops - starts
    enough = (count[0] >= _SEEN * length) & (count[1] >= _SEEN * (values.shape[1] - length))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = [f / n for f, n in zip(first, count, strict=True)]
        variance = [np.maximum(s / n - m**2, 0.0) for s, n, m in zip(second, count, mean, strict=True)]
        mean = [m + centre for m in mean]
        found = np.stack([np.stack(mean, axis=1), np.cbrt(np.stack(variance, axis=1))], axis=1)
    return np.where(enough[:, None, None], found, np.nan)


def _refined(values: np.ndarray, start: int, stop: int, statistic: str) -> tuple[int, int]:
    """Where a stretch begins and ends more closely, by the likelihood of two means or two variances near the one found.

    Up to its own length longer and down to half of it; the ends of the record stay.
    """
    steps, length = len(values), stop - start
    seen = np.isfinite(values)
    apart = np.where(seen, values - np.nanmean(values), 0.0)
    n, first, second = (np.concatenate([[0.0], np.cumsum(v)]) for v in (seen, apart, apart**2))
    grain = -(-length // MOST_EDGES)
    begins = np.array([0]) if start == 0 else _edges(max(0, start - length), start + length // 2, steps - 1, grain)
    ends = np.array([stop]) if stop == steps else _edges(max(stop - length // 2, 1), stop + length, steps, grain)
    i, j = (grid.ravel() for grid in np.meshgrid(begins, ends, indexing="ij"))
    keep = j - i >= max(2, length // 2)
    i, j = i[keep], j[keep]
    inside = [v[j] - v[i] for v in (n, first, second)]
    outside = [v[-1] - w for v, w in zip((n, first, second), inside, strict=True)]
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = [s / m - (f / m) ** 2 for m, f, s in (inside, outside)]
        if statistic == "mean":
            cost = inside[0] * spread[0] + outside[0] * spread[1]
        else:
            tiny = np.finfo(float).tiny
            cost = sum(m[0] * np.log(np.maximum(v, tiny)) for m, v in zip((inside, outside), spread, strict=True))
    cost = np.where((inside[0] >= 2) & (outside[0] >= 2), cost, np.inf)
    if not np.isfinite(cost).any():
        return start, stop
    best = int(np.argmin(cost))
    return int(i[best]), int(j[best])


def _edges(first: int, last: int, most: int, grain: int) -> np.ndarray:
    """Places from one to another, but no farther than the most, so many steps apart."""
    return np.arange(first, min(last, most) + 1, grain)


def _finding(
    residuals: Residuals, k: int, statistic: str, amount: float, t: float, p_value: float, first: float, last: float
) -> Finding:
    words = {"mean": "measured higher" if amount > 0 else "measured lower", "variance": "more scatter"}
    begin = float(residuals.time[0] - residuals.step)
    return Finding(
        kind="episode",
        channel=residuals.names[k],
        label=residuals.labels[k],
        cell=period(begin, first, last, float(residuals.time[-1])) | {"statistic": statistic},
        p_value=p_value,
        direction=f"{words[statistic]} {REST}",
        size=amount,
        unit=residuals.units[k],
        t=t,
    )


def period(begin: float, first: float, last: float, end: float) -> dict[str, str]:
    """A stretch in words, and when it begins and ends [s]; ``begin`` and ``end`` are the recording's."""
    days = [(at - begin) / DAY for at in (first, last)]
    words = f"from day {days[0]:.2f} on" if last >= end else f"from day {days[0]:.2f} to day {days[1]:.2f}"
    return {"period": words, "first_s": f"{first:.0f}", "last_s": f"{last:.0f}"}
