"""Which cells are off: channel x hours x day type x regime x frequency band, by mean and by variance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.where.finding import Finding, Window, all_windows
from diagnosis.where.series import ALPHA, DAY, EDGES, WHOLE, MaxTest, Residuals, band_names, max_test, split
from shared.system import System
from shared.units import spelled
from shared.variables import ZERO_CELSIUS, Output

ANY = "any"
_SUN_SHARE = 0.2
"""Sun is out above this share of the record's 99th percentile of irradiance."""
_AT_BOUND = 0.01
"""Share of the steps that must lie on a series' extreme for it to be a bound."""
_RARE = 0.02
"""Regimes that hold for less than this share of the record, or are absent for less, say nothing."""


@dataclass(frozen=True)
class Regime:
    """A state: what a reader calls it, the rule it follows, and when it holds: ``mask`` (steps,)."""

    label: str
    rule: str
    mask: np.ndarray


def everywhere(steps: int) -> Regime:
    """The regime that always holds."""
    return Regime(ANY, "always", np.ones(steps, bool))


def find_regimes(system: System, inputs: Mapping[str, np.ndarray], simulated: np.ndarray) -> list[Regime]:
    """Derive regimes from the kinds of inputs and from where outputs dwell.

    Outputs must be those that the calibrated model *simulates*, not the measured ones: "measured CO2 is high" picks
    the steps where its error is high, which twins that are not picked by their own errors could not imitate.

    Parameters
    ----------
    inputs
        Recorded inputs by name, each (steps,); those that were not recorded are left out.
    simulated
        Outputs of the calibrated model, shape (outputs, steps).
    """
    found: list[Regime] = []
    for one in system.inputs:
        if one.name in inputs and np.isfinite(inputs[one.name]).all():
            found += _of_input(one.source, getattr(one, "column", ""), one.name, one.unit, inputs[one.name])
    for output, series in zip(system.outputs, simulated, strict=True):
        if np.isfinite(series).all():
            found += _of_output(output, series)
    return [r for r in found if _RARE <= r.mask.mean() <= 1 - _RARE]


def _of_input(source: str, column: str, name: str, unit: str, series: np.ndarray) -> list[Regime]:
    if source == "constant" or source == "excitation" or np.ptp(series) == 0:
        return []
    if source == "occupancy":
        return [
            Regime("occupied", f"{name} > 0", series > 0),
            Regime("empty", f"{name} = 0", series <= 0),
        ]
    if source == "weather" and spelled(unit) == "W/m2":
        threshold = float(_SUN_SHARE * np.percentile(series, 99))
        return [Regime(f"sun on {name}", _above(name, threshold, unit), series > threshold)]
    if source == "weather" and column == "wind_speed":
        threshold = float(np.quantile(series, 0.75))
        return [Regime(f"wind above {threshold:.2g} {unit}", _above(name, threshold, unit), series > threshold)]
    if source == "weather" and column == "temp_air":
        low, high = (float(np.quantile(series, q)) for q in (0.25, 0.75))
        return [
            Regime(f"below {_warmth(low, unit)} outside", f"{name} < {low:.4g} {unit}", series < low),
            Regime(f"above {_warmth(high, unit)} outside", _above(name, high, unit), series > high),
        ]
    if source == "weather":
        # sky temperature and its like move with what has a name already
        return []
    if source == "schedule":
        threshold = float((series.min() + series.max()) / 2)
        return [Regime(f"{name} in its upper half", _above(name, threshold, unit), series > threshold)]
    threshold = float(np.median(series[series != 0])) if (series != 0).any() else 0.0
    return [Regime(f"{name} high", _above(name, threshold, unit), series > threshold)]


def _of_output(output: Output, series: np.ndarray) -> list[Regime]:
    """An actuator dwells on its bounds: at rest, working, saturated. A state does not: its upper quarter."""
    label, unit, close = output.long_name or output.name, output.unit, 3 * output.accuracy
    low, high = float(series.min()), float(series.max())
    at_low, at_high = series <= low + close, series >= high - close
    wide = high - low > 10 * close
    found = []
    if wide and at_low.mean() >= 5 * _AT_BOUND:
        found.append(Regime(f"{label} above its minimum", _above(output.name, low + close, unit), ~at_low))
    else:
        threshold = float(np.quantile(series, 0.75))
        found.append(Regime(f"{label} high", _above(output.name, threshold, unit), series > threshold))
    if wide and at_high.mean() >= _AT_BOUND:
        found.append(Regime(f"{label} at its maximum", _above(output.name, high - close, unit), at_high))
    return found


def _warmth(value: float, unit: str) -> str:
    """A temperature as people say it: its coldest quarter may be warm."""
    return f"{value - ZERO_CELSIUS:.1f} degC" if spelled(unit) == "K" else f"{value:.1f} {unit}"


def _above(name: str, threshold: float, unit: str) -> str:
    return f"{name} > {threshold:.4g} {unit}"


@dataclass
class Offsets:
    """What the places that were named take from one channel's residual.

    An offset of everything that is named first is the mean of what holds and what does not; once the part that it does
    not hold for is named as well, it is another one. So all are fitted anew with each place that is added.

    Parameters
    ----------
    series
        The channel's residual [unit], shape (steps,); NaN where nothing was measured.
    step
        [s]
    scatter
        Variance of each band of the twins, from :func:`band_scatter`.
    """

    series: np.ndarray
    step: float
    scatter: list[float]
    places: list[np.ndarray] = field(default_factory=list)
    sizes: np.ndarray = field(default_factory=lambda: np.empty(0))

    def add(self, inside: np.ndarray) -> float:
        """Name a place (steps,), fit all anew, and return its offset [unit].

        Each band is weighted by its scatter: one band alone would not do, a wave looks in it like an offset that is far
        larger than the wave.
        """
        self.places.append(inside)
        self._fit()
        return float(self.sizes[-1])

    def change(self, inside: np.ndarray, by: np.ndarray) -> None:
        """Add something else to the residual within a place, and fit all anew."""
        self.series = self.series.copy()
        self.series[inside] += by
        self._fit()

    @property
    def left(self) -> np.ndarray:
        """The residual without all offsets [unit], shape (steps,)."""
        left = self.series.copy()
        for inside, size in zip(self.places, self.sizes, strict=True):
            left[inside] -= size
        return left

    def overlap(self, inside: np.ndarray) -> bool:
        """Whether a place shares a step with one that was named."""
        return any(bool((one & inside).any()) for one in self.places)

    def _fit(self) -> None:
        if not self.places:
            return
        seen = np.isfinite(self.series)
        shapes = _parts(np.where(seen, np.array(self.places, dtype=float), np.nan), self.step)
        normal, across = np.zeros((len(self.places),) * 2), np.zeros(len(self.places))
        for part, shape, variance in zip(_parts(self.series, self.step), shapes, self.scatter, strict=True):
            normal += shape[:, seen] @ shape[:, seen].T / variance
            across += shape[:, seen] @ part[seen] / variance
        # places that add up to another leave a choice: the least offsets
        self.sizes = np.linalg.lstsq(normal, across, rcond=1e-10)[0]


def band_scatter(values: np.ndarray, step: float, floor: float) -> list[float]:
    """Variance of each band of a channel's twins (rows, steps), the whole left out unless it is all there is."""
    return [max(float(np.nanvar(one)), floor) for one in _parts(values, step)]


def _parts(values: np.ndarray, step: float) -> list[np.ndarray]:
    parts = list(split(values, step).values())
    return parts[1:] or parts


STATISTICS = ("mean", "variance")
_WORDS = ("measured higher", "measured lower")
_DAYS = 2
"""A cell must be seen on as many days: a single day is an episode's business."""
_SAMPLES = 8
"""A variance must rest on as many readings."""
_RESOLVED = 0.1
"""A band's mean takes part where the band keeps this share of an offset that is confined to the cell."""
_AS_STRONG = 0.95
"""A cell with fewer conditions is named instead of the strongest from this share of its studentised value on."""
_OFFSET_SHARE = 1 / 2
"""A mean is named before a variance of its channel from this share of the variance's studentised value on."""
_SAME = 0.5
"""Cells of a channel that share this part of the steps at which one or the other holds are one place, named once."""
_SEEN = 0.5
"""An excess over what was named before is told where the residual itself shows this share of it."""
_ROUNDS = 2
"""Times as many cells are looked at as are named at most: of some nothing is said."""
_FLOOR = 1e-6
"""Variances below the square of this share of the channel's spread are rounding."""


@dataclass(frozen=True)
class CellTest:
    """Result of :func:`scan_cells`.

    The cells of ``test`` are laid out as ``shape``: (channels, bands, statistics, regimes, windows). ``alias`` points
    every cell to the one that stands for it (cells that hold at the same steps are tested once); ``channels`` are
    indices of outputs.
    """

    test: MaxTest
    channels: list[int]
    bands: list[str]
    regimes: list[Regime]
    windows: list[Window]
    alias: np.ndarray
    findings: list[Finding]

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        """Channels, bands, statistics, regimes, windows."""
        return len(self.channels), len(self.bands), len(STATISTICS), len(self.regimes), len(self.windows)

    def laid_out(self, values: np.ndarray) -> np.ndarray:
        """Values of cells, each read where its alias lies, in the layout of ``shape``."""
        return values[self.alias].reshape(self.shape)


def scan_cells(residuals: Residuals, regimes: Sequence[Regime] = (), *, most: int = 8) -> CellTest:
    """Test every cell's mean and variance against the twins', all under one p-value.

    Of variances only larger ones count: a recording that scatters less than its twins, as one that is quieter than its
    declared noise, has no gap by that.

    Variances enter as cube roots, which are nearly normal (Wilson and Hilferty 1931): the skewed variance of a
    small cell would otherwise set the threshold for all means.

    A finding is peeled off the recording's residual before the next is looked for (still against the twins' largest
    statistic of the first round), so that one cause is not reported by all the cells that overlap it.

    Parameters
    ----------
    regimes
        From :func:`~diagnosis.where.cells.find_regimes`; that which always holds is added.
    most
        At most as many findings.
    """
    steps = len(residuals.time)
    states = [everywhere(steps), *regimes]
    windows, holds = all_windows(residuals)
    bands = band_names(residuals.step, steps)
    channels = residuals.measured
    shape = (len(channels), len(bands), len(STATISTICS), len(states), len(windows))
    stack = residuals.stacked
    statistics = np.empty((len(stack), *shape))
    share = np.zeros(shape)
    alias = np.arange(share.size).reshape(shape)
    for c, k in enumerate(channels):
        floor = _floor(stack[:, k])
        statistics[:, c] = _statistics(stack[:, k], states, holds, residuals.step, floor)
        used, first = _tested(stack[0, k], states, holds, residuals.day)
        share[c] = _share(stack[0, k], states, holds, residuals.step)
        statistics[:, c][..., ~used] = np.nan
        alias[c] = np.take_along_axis(
            alias[c].reshape(*shape[1:3], -1), np.broadcast_to(first.ravel(), (*shape[1:3], first.size)), axis=-1
        ).reshape(shape[1:])
    unresolved = share < _RESOLVED
    unresolved[:, :, STATISTICS.index("variance")] = False
    # what changes over days is nearly the same at all hours of one: which of them is named would be chance
    of_days = np.array([EDGES.get(band, 0.0) > DAY for band in bands])
    unresolved |= of_days[:, None, None, None] & np.array([one.hours != "any" for one in windows])
    statistics[:, unresolved] = np.nan
    scatter = np.broadcast_to(np.arange(len(STATISTICS))[:, None, None] == STATISTICS.index("variance"), shape)
    test = max_test(statistics.reshape(len(stack), -1), upper=scatter.ravel())
    found = CellTest(test, channels, bands, states, windows, alias.ravel(), [])
    found.findings.extend(_peel(residuals, found, holds, most))
    return found


def _floor(values: np.ndarray) -> float:
    return float((_FLOOR * np.nanstd(values)) ** 2) or np.finfo(float).tiny


def _statistics(
    values: np.ndarray, states: Sequence[Regime], holds: np.ndarray, step: float, floor: float
) -> np.ndarray:
    """Means and cube roots of variances (rows, bands, 2, regimes, windows) of one channel's rows (rows, steps)."""
    seen = np.isfinite(values)
    inside = holds.T.astype(float)
    counts = np.stack([(seen & state.mask) @ inside for state in states], 1)
    parts = split(values, step)
    found = np.full((len(values), len(parts), len(STATISTICS), len(states), len(holds)), np.nan)
    for b, part in enumerate(parts.values()):
        filled = np.where(seen, part, 0.0)
        for r, state in enumerate(states):
            kept = filled * state.mask
            with np.errstate(invalid="ignore", divide="ignore"):
                mean = (kept @ inside) / counts[:, r]
                variance = (kept * filled) @ inside / counts[:, r] - mean**2
                found[:, b, 0, r] = mean
                found[:, b, 1, r] = np.where(counts[:, r] >= _SAMPLES, np.cbrt(np.maximum(variance, floor)), np.nan)
    return found


def _tested(
    observed: np.ndarray, states: Sequence[Regime], holds: np.ndarray, day: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which (regimes, windows) are tested, and the index of the one that stands for each."""
    seen = np.isfinite(observed)
    masks = (np.stack([state.mask for state in states])[:, None] & holds & seen).reshape(-1, len(seen))
    number = np.unique(day, return_inverse=True)[1]
    days = np.eye(number.max() + 1)[number]
    enough = (masks @ days > 0).sum(axis=1) >= _DAYS
    _, first, inverse = np.unique(np.packbits(masks, axis=1), axis=0, return_index=True, return_inverse=True)
    stands = first[inverse.ravel()]
    used = enough & (stands == np.arange(len(masks)))
    return used.reshape(len(states), len(holds)), stands.reshape(len(states), len(holds))


def _share(observed: np.ndarray, states: Sequence[Regime], holds: np.ndarray, step: float) -> np.ndarray:
    """What each band keeps of a unit offset confined to a cell, shape (bands, 2, regimes, windows)."""
    seen = np.isfinite(observed)
    shares = []
    for state in states:
        masks = holds & state.mask & seen
        parts = split(np.where(seen, masks.astype(float), np.nan), step)
        count = np.maximum(masks.sum(axis=1), 1)
        shares.append([np.where(masks, part, 0.0).sum(axis=1) / count for part in parts.values()])
    return np.repeat(np.array(shares).transpose(1, 0, 2)[:, None], len(STATISTICS), axis=1)


def _peel(residuals: Residuals, cells: CellTest, holds: np.ndarray, most: int) -> list[Finding]:
    """Findings, each looked for in what the ones before it leave.

    An offset in part of a cell widens the whole, and scatter moves the mean of some hour: a mean is named first, unless
    its channel's scatter stands out far more. What holds at nearly the same steps as a cell that was named is not named
    again, in whatever band: of an excess that is no offset something is left.
    """
    floors = [_floor(residuals.stacked[:, k]) for k in cells.channels]
    seen = np.isfinite(residuals.stacked[0])
    masks = [np.stack([one.mask & holds for one in cells.regimes]) & seen[k] for k in cells.channels]
    statistics = np.where(cells.test.kept, cells.test.observed, np.nan)
    t, adjusted = cells.test.t, cells.test.adjusted
    open_ = np.ones((cells.shape[0], *cells.shape[3:]), dtype=bool)
    taken: dict[int, Offsets] = {}
    found: list[Finding] = []
    for _ in range(_ROUNDS * most):
        size = np.where(cells.test.kept & (adjusted <= ALPHA), np.abs(t), -np.inf).reshape(cells.shape)
        size = np.where(open_[:, None, None], size, -np.inf)
        mean, variance = size.copy(), size.copy()
        mean[:, :, 1], variance[:, :, 0] = -np.inf, -np.inf
        widest = variance.max(axis=(1, 2, 3, 4), keepdims=True)
        mean[mean < _OFFSET_SHARE * widest] = -np.inf
        named = (mean if np.isfinite(mean).any() else variance).ravel()
        if len(found) == most or not np.isfinite(named).any():
            break
        top = _simplest(np.flatnonzero(named >= _AS_STRONG * named.max()), named, cells)
        c, _, _, r, w = (int(i) for i in np.unravel_index(top, cells.shape))
        k = cells.channels[c]
        inside = masks[c][r, w]
        if c not in taken:
            scatter = band_scatter(residuals.stacked[1:, k], residuals.step, floors[c])
            taken[c] = Offsets(residuals.stacked[0, k], residuals.step, scatter)
        both = masks[c][..., inside].sum(axis=-1)
        open_[c] &= both < _SAME * (masks[c].sum(axis=-1) + inside.sum() - both)
        stands = float(t[top]), float(adjusted[top])
        said = _taken_off(taken[c], inside, top, float(statistics[top]), stands, cells, residuals)
        if said is not None:
            found.append(_finding(residuals, cells, top, *said))
        block = statistics.reshape(cells.shape)
        block[c] = _statistics(taken[c].left[None], cells.regimes, holds, residuals.step, floors[c])[0]
        statistics = np.where(cells.test.kept, block.ravel(), np.nan)
        t, adjusted = cells.test.restudentise(statistics)
    return found


def _taken_off(
    taken: Offsets,
    inside: np.ndarray,
    top: int,
    value: float,
    stands: tuple[float, float],
    cells: CellTest,
    residuals: Residuals,
) -> tuple[str, float, float, float] | None:
    """Take the excess of a cell off its channel; what is to be said of it: words, size [unit], studentised value and p.

    None if nothing is true. ``stands``: studentised value and p of the cell in what is left.

    The excess is one over what was named before, but what is said is of the residual itself: where an offset of
    everything does not hold, nothing is measured higher than the model has it, only higher than elsewhere.
    """
    c, b, s, r, w = (int(i) for i in np.unravel_index(top, cells.shape))
    usual, t = float(cells.test.typical[top]), stands[0]
    if STATISTICS[s] == "variance":
        part = split(taken.left, residuals.step)[cells.bands[b]][inside]
        sd, usual_sd = value**1.5, max(usual, 0.0) ** 1.5
        taken.change(inside, (part - part.mean()) * (usual_sd / sd - 1))
        return ("more scatter", sd - usual_sd, *stands) if cells.test.t[top] > 0 else None
    words, overlaps = _WORDS[t < 0], taken.overlap(inside)
    amount = taken.add(inside)
    raw = int(cells.alias[np.ravel_multi_index((c, cells.bands.index(WHOLE), s, r, w), cells.shape)])
    apart = float(cells.test.observed[raw] - cells.test.typical[raw])
    if apart * t > 0 and cells.test.adjusted[raw] <= ALPHA:
        # beside an offset that was named the cell must stand out on its own as well
        itself = float(cells.test.t[raw]), float(cells.test.adjusted[raw])
        return words, apart, *(min(stands, itself, key=lambda one: abs(one[0])) if overlaps else stands)
    if apart * t > 0 and amount * t > 0 and not overlaps:
        return words, amount, *stands
    rows = residuals.stacked[:, cells.channels[c]]
    beside = np.isfinite(rows[0]) & ~inside
    means = [rows[0, one].mean() - np.nanmean(rows[1:, one]) for one in (inside, beside) if one.any()]
    contrast = float(means[0] - means[-1])
    seen = contrast * t > 0 and abs(contrast) >= _SEEN * abs(amount)
    return (f"{words} than elsewhere", contrast, *stands) if seen else None


def _simplest(candidates: np.ndarray, size: np.ndarray, cells: CellTest) -> int:
    """Of cells that are about as strong the one with the fewest conditions, and of those the strongest."""
    _, b, _, r, w = np.unravel_index(candidates, cells.shape)
    conditions = [
        (r_ > 0) + (cells.windows[w_].hours != "any") + (cells.windows[w_].day_type != "any") + (b_ > 0)
        for b_, r_, w_ in zip(b, r, w, strict=True)
    ]
    order = np.lexsort((-size[candidates], np.array(conditions)))
    return int(candidates[order[0]])


def _finding(
    residuals: Residuals, cells: CellTest, top: int, words: str, amount: float, t: float, p_value: float
) -> Finding:
    c, b, s, r, w = (int(i) for i in np.unravel_index(top, cells.shape))
    k, window = cells.channels[c], cells.windows[w]
    return Finding(
        kind="cell",
        channel=residuals.names[k],
        label=residuals.labels[k],
        cell={
            "hours": window.hours,
            "day_type": window.day_type,
            "regime": cells.regimes[r].label,
            "rule": cells.regimes[r].rule,
            "band": cells.bands[b],
            "statistic": STATISTICS[s],
        },
        p_value=p_value,
        direction=words,
        size=amount,
        unit=residuals.units[k],
        t=t,
    )
