"""Pictures of cells and correlations, each with its key in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from diagnosis.curves import BLUE, GREY, ORANGE, calendar, dates
from diagnosis.panels import Curve, Panel, Strips
from diagnosis.where.cells import STATISTICS, CellTest
from diagnosis.where.correlation import CorrelationTest
from diagnosis.where.episodes import REST, EpisodeTest
from diagnosis.where.series import ALPHA, BRIEF, DAY, HOUR, WHOLE, Residuals
from diagnosis.where.sources import SourceTest
from shared.numbers import number
from shared.variables import spaced

MEASURED = "#cc3311"
TWINS = "#bbbbbb"
QUIET = "#4477aa"
OUTLINE = "black"
DIVERGING = "RdBu_r"


def outline(axes: Axes, mask: np.ndarray) -> None:
    """A frame around every connected group of an image's cells; ``mask`` (rows, columns)."""
    padded = np.pad(mask, 1)
    lines = []
    for i, j in np.argwhere(mask):
        if not padded[i, j + 1]:
            lines.append([(j - 0.5, i - 0.5), (j + 0.5, i - 0.5)])
        if not padded[i + 2, j + 1]:
            lines.append([(j - 0.5, i + 0.5), (j + 0.5, i + 0.5)])
        if not padded[i + 1, j]:
            lines.append([(j - 0.5, i - 0.5), (j - 0.5, i + 0.5)])
        if not padded[i + 1, j + 2]:
            lines.append([(j + 0.5, i - 0.5), (j + 0.5, i + 0.5)])
    axes.add_collection(LineCollection(lines, colors=OUTLINE, linewidths=1.8, capstyle="projecting", clip_on=False))


def few_digits(unit: str, peak: float) -> tuple[float, str]:
    """Factor and unit in which a peak is a number of a few digits."""
    if unit == "kg/s" and 0 < peak < 1e-3:
        return 1e6, "mg/s"
    if unit == "W" and peak >= 2e4:
        return 1e-3, "kW"
    return 1.0, unit


_UNTESTED = "#dddddd"
MOST = 10.0
"""The colours of scatter end at so many times that of replicates, and at that part of it."""


def draw_cells(residuals: Residuals, cells: CellTest) -> Figure:
    """Offsets by hour and state, and scatter by speed and state: a row of two panels for each channel."""
    rows, count = _rows(cells), len(cells.channels)
    tall = 0.21 * len(rows) + 1.15
    figure = Figure(figsize=(12.5, tall * count + 0.9), layout="constrained")
    panels = figure.subplots(
        count, 2, squeeze=False, gridspec_kw={"width_ratios": [2.9, len(cells.bands) * 0.28 + 0.2]}
    )
    for c in range(count):
        _draw_offsets(figure, panels[c, 0], residuals, cells, c, rows)
        _draw_scatter(figure, panels[c, 1], cells, c, rows)
    figure.suptitle(
        "Where measurement and calibrated model differ\n"
        "Left: red measured higher, blue lower.  Right: red more scatter than replicates without a gap, blue less.\n"
        f"Black frame: beyond what {len(residuals.replicates)} replicates show anywhere; right only more.  "
        "Grey: too few readings.",
        fontsize=10,
    )
    return figure


def _rows(cells: CellTest) -> list[tuple[str, int, str]]:
    """(label, regime, day type) of the rows: day types first, then regimes on any day."""
    rows = [("all days", 0, "any")]
    if any(w.day_type == "weekend" for w in cells.windows):
        rows += [("weekdays", 0, "weekday"), ("weekends", 0, "weekend")]
    return rows + [(r.label, k, "any") for k, r in enumerate(cells.regimes) if k > 0]


def _draw_offsets(
    figure: Figure, axes: Axes, residuals: Residuals, cells: CellTest, c: int, rows: list[tuple[str, int, str]]
) -> None:
    k, mean, whole = cells.channels[c], STATISTICS.index("mean"), cells.bands.index(WHOLE)
    apart = cells.laid_out(cells.test.observed - cells.test.typical)[c, :, mean]
    sure = cells.laid_out(cells.test.adjusted)[c, :, mean] <= ALPHA
    shortest = min(w.stop - w.start for w in cells.windows)
    hours = sorted({(w.start, w.stop) for w in cells.windows if w.stop - w.start == shortest})
    spans = [*hours, (0, 24)] if hours != [(0, 24)] else hours
    at = {(w.start, w.stop, w.day_type): j for j, w in enumerate(cells.windows)}
    image = np.full((len(rows), len(spans)), np.nan)
    framed = np.zeros(image.shape, bool)
    for i, (_, regime, day_type) in enumerate(rows):
        for j, (start, stop) in enumerate(spans):
            window = at[start, stop, day_type]
            image[i, j] = apart[whole, regime, window]
            # a band-pass filter answers an offset with lobes of the other sign beside it: those are not framed
            agrees = np.sign(apart[:, regime, window]) == np.sign(image[i, j])
            framed[i, j] = (sure[:, regime, window] & agrees).any()
    limit = float(np.nanmax(np.abs(image))) if np.isfinite(image).any() else 1.0
    axes.set_facecolor(_UNTESTED)
    shown = axes.imshow(image, cmap=DIVERGING, vmin=-limit, vmax=limit, aspect="auto", interpolation="nearest")
    outline(axes, framed)
    if len(spans) > 1:
        axes.axvline(len(spans) - 1.5, color="black", linewidth=2)
    days = sum(regime == 0 for _, regime, _ in rows)
    axes.axhline(days - 0.5, color="black", linewidth=0.8)
    axes.set_yticks(range(len(rows)), [label for label, _, _ in rows], fontsize=8)
    ticks = [j for j, (start, _) in enumerate(spans[:-1]) if start % 3 == 0]
    axes.set_xticks([*ticks, len(spans) - 1], [*(f"{spans[j][0]:02d}" for j in ticks), "all"], fontsize=8)
    axes.set_xlabel("hour of the day (standard time)", fontsize=8)
    axes.set_title(f"{residuals.labels[k]}: measured minus model", fontsize=10, loc="left", fontweight="bold")
    bar = figure.colorbar(shown, ax=axes, pad=0.01, fraction=0.04)
    bar.set_label(residuals.units[k], fontsize=8)
    bar.ax.tick_params(labelsize=7)


def _draw_scatter(figure: Figure, axes: Axes, cells: CellTest, c: int, rows: list[tuple[str, int, str]]) -> None:
    variance = STATISTICS.index("variance")
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = (cells.laid_out(cells.test.observed) / cells.laid_out(cells.test.typical))[c, :, variance] ** 1.5
    sure = cells.laid_out(cells.test.adjusted)[c, :, variance] <= ALPHA
    at = {w.day_type: j for j, w in enumerate(cells.windows) if (w.start, w.stop) == (0, 24)}
    image = np.array([[ratio[b, regime, at[day]] for b in range(len(cells.bands))] for _, regime, day in rows])
    largest = float(np.nanmax(np.maximum(image, 1 / np.maximum(image, 1e-9)))) if np.isfinite(image).any() else 2.0
    bound = min(max(2.0, largest), MOST)  # one odd cell must not bleach all others
    axes.set_facecolor(_UNTESTED)
    shown = axes.imshow(image, cmap=DIVERGING, norm=LogNorm(1 / bound, bound), aspect="auto", interpolation="nearest")
    framed = np.array([[sure[b, regime, at[day]] for b in range(len(cells.bands))] for _, regime, day in rows])
    outline(axes, framed & (image > 1))  # twins that scatter more than the recording are no gap of it
    for i in range(len(rows)):
        for b in range(len(cells.bands)):
            if np.isfinite(image[i, b]):
                dark = abs(np.log(max(image[i, b], 1e-9))) > 0.6 * np.log(bound)
                axes.text(
                    b, i, _ratio(image[i, b]), ha="center", va="center", fontsize=7, color="white" if dark else "black"
                )
    axes.set_yticks([])
    axes.set_xticks(range(len(cells.bands)), [BRIEF[b] for b in cells.bands], fontsize=8)
    axes.set_xlabel("periods in the residual", fontsize=8)
    axes.set_title("scatter, times that of replicates", fontsize=10, loc="left")
    bar = figure.colorbar(shown, ax=axes, pad=0.02, fraction=0.06)
    bar.ax.tick_params(labelsize=7)
    bar.set_ticks([1 / bound, bound**-0.5, 1.0, bound**0.5, bound])
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"x{value:.2g}"))
    bar.ax.yaxis.set_minor_formatter(NullFormatter())


def _ratio(value: float) -> str:
    """A ratio of two significant digits that fits into a cell."""
    return "<.01" if value < 0.01 else ">99" if value >= 99.5 else f"{value:#.2g}".rstrip(".")


def draw_correlations(residuals: Residuals, found: CorrelationTest, *, most: int = 3) -> Figure:
    """Stems of each channel's residual against the inputs it follows most, with the twins' bands."""
    t = np.abs(found.test.t.reshape(found.correlation.shape))
    strongest = np.where(np.isfinite(t), t, 0.0).max(axis=2)
    across = min(most, len(found.inputs))
    down = len(found.channels)
    figure = Figure(figsize=(4.1 * across, 2.35 * down + 1.0), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False, sharex=True)
    hours = found.lags / HOUR
    for c, k in enumerate(found.channels):
        chosen = np.argsort(-strongest[c])[:across]
        values = (found.correlation, found.simultaneous_low, found.simultaneous_high)
        largest = max(float(np.abs(np.nan_to_num(one[c, chosen])).max()) for one in values)
        limit = 1.15 * largest or 1.0  # of a channel that was hardly read there are none
        for axes, i in zip(panels[c], chosen, strict=True):
            sure = found.adjusted[c, i] <= ALPHA
            axes.fill_between(hours, found.low[c, i], found.high[c, i], color=TWINS, alpha=0.6, linewidth=0)
            for edge in (found.simultaneous_low, found.simultaneous_high):
                axes.plot(hours, edge[c, i], color="black", linewidth=0.8, linestyle="--")
            for mask, colour in ((~sure, QUIET), (sure, MEASURED)):
                if mask.any():
                    axes.vlines(hours[mask], 0, found.correlation[c, i, mask], color=colour, linewidth=1.4)
                    axes.plot(hours[mask], found.correlation[c, i, mask], "o", color=colour, markersize=2.6)
            axes.axhline(0, color="black", linewidth=0.6)
            axes.axvline(0, color="black", linewidth=0.6, linestyle=":")
            axes.set_ylim(-limit, limit)
            axes.set_xticks(np.arange(np.ceil(hours[0] / 6) * 6, hours[-1] + 1, 6))
            axes.tick_params(labelsize=7)
            axes.set_title(f"{residuals.labels[k]}  after  {found.inputs[i]}", fontsize=9)
            if c == down - 1:
                axes.set_xlabel("residual comes this many hours after the input", fontsize=8)
        panels[c, 0].set_ylabel("correlation", fontsize=8)
    figure.suptitle(
        "Which inputs the residual follows\n"
        "Dashed: what 19 of 20 replicates without a gap cross nowhere.  Red stems: significant, whatever is looked at. "
        "Grey: 95 % of replicates at that lag alone.",
        fontsize=10,
    )
    return figure


_ROWS, _LABEL = 5, 0.13
"""Heights at which labels of stretches stand at least, and the height of one, as a share of the panel's."""
_SPAN = "#ee9944"
_WEEKEND = "#f3efe0"


def draw_episodes(residuals: Residuals, found: EpisodeTest, *, zero: np.datetime64 | None = None) -> Figure:
    """The residual of each channel against time, what replicates show, and the stretches that stand out.

    ``zero`` is the date from which time runs, for dates below the days.
    """
    down = len(found.channels)
    figure = Figure(figsize=(12.5, 2.1 * down + 0.9), layout="constrained")
    panels = figure.subplots(down, 1, squeeze=False, sharex=True)[:, 0]
    begin = float(residuals.time[0] - residuals.step)
    days = (residuals.middle - begin) / DAY
    for axes, k in zip(panels, found.channels, strict=True):
        low, high = _band(residuals.replicates[:, k])
        axes.fill_between(
            days, low, high, color=TWINS, alpha=0.7, linewidth=0, label="95 % of replicates without a gap"
        )
        axes.axhline(0, color="black", linewidth=0.6)
        axes.plot(days, residuals.observed[k], color=QUIET, linewidth=0.9, label="this recording")
        _weekends(axes, residuals, begin)
        _within(axes, residuals.observed[k], low, high)
        own = [
            (one, span)
            for one, span in zip(found.findings, found.spans, strict=True)
            if one.channel == residuals.names[k] and one.p_value <= ALPHA
        ]
        heights = np.linspace(0.95, 0.05 + _LABEL, max(len(own), _ROWS))
        for place, (one, (first, last)) in enumerate(own):
            first, last = (first - begin) / DAY, (last - begin) / DAY
            briefly = one.direction.replace(REST, "than the rest").removeprefix("measured ")
            axes.axvspan(first, last, color=_SPAN, alpha=0.35, linewidth=0)
            for edge in (first, last):
                axes.axvline(edge, color=MEASURED, linewidth=1.0, linestyle="--")
            axes.text(
                (first + last) / 2,
                heights[place],
                f"{briefly} by {number(abs(one.size), 3)}{spaced(one.unit)}",
                transform=axes.get_xaxis_transform(),
                ha="left"
                if (first + last) / 2 < days[-1] * 0.12
                else "right"
                if (first + last) / 2 > days[-1] * 0.88
                else "center",
                va="top",
                fontsize=8,
                bbox={"facecolor": "white", "edgecolor": MEASURED, "pad": 1.5, "alpha": 0.9},
                zorder=3 + (len(own) - place) / len(own),  # the surest on top
            )
        _frame(axes, days, f"{residuals.labels[k]}\n[{residuals.units[k]}]")
    panels[0].legend(fontsize=8, loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False)
    _days_below(panels[-1], begin, zero)
    figure.suptitle(
        "When the residual (measured minus model) changes\n"
        "Orange: stretches that differ from the rest of the recording.  Light stripes: weekends.",
        fontsize=10,
    )
    return figure


def source_panels(
    residuals: Residuals, found: SourceTest, zero: np.datetime64, *, explained: Mapping[str, np.ndarray] | None = None
) -> list[Panel]:
    """Each source that would close the residual, its uncertainty, and what replicates without a gap would ask for.

    ``zero`` is the date from which time runs. ``explained`` by source (pulses,): what the effects found account for.
    """
    first = np.unique(residuals.day[residuals.weekend]) * DAY
    weekends = Strips("weekends", _WEEKEND, dates(zero, first), dates(zero, first + DAY))
    made, marks = [], []
    for one in found.sources:
        factor, unit = few_digits(one.unit, max(float(np.abs(one.estimate).max()), float(np.abs(one.high).max())))
        spread = np.stack([one.estimate - 2 * one.uncertainty, one.estimate + 2 * one.uncertainty])
        curves = [
            Curve("95 % of replicates without a gap", GREY, factor * np.stack([one.low, one.high])),
            Curve("two standard deviations either side", ORANGE, factor * spread),
            Curve("what the base model lacks", ORANGE, factor * one.estimate),
        ]
        if explained is not None:
            curves.append(Curve("what the effects found account for", BLUE, factor * explained[one.name], "dashed"))
        # a pulse may stand out at another smoothness than the one drawn: mark it only where the drawing agrees
        outside = (one.estimate > one.high) | (one.estimate < one.low)
        sure = (one.adjusted <= ALPHA) & outside & (np.abs(one.estimate) > 2 * one.uncertainty)
        marked = np.where(sure, factor * one.estimate, np.nan)
        marks.append(Curve(f"beyond all replicates (p <= {ALPHA:g})", MEASURED, marked, "marks"))
        centres = dates(zero, (one.edges[1:] + one.edges[:-1]) / 2)
        made.append(Panel(one.label, unit, centres, curves, [weekends], stepwise=True))
    if not any(np.isfinite(one.values).any() for one in marks):
        return made
    return [replace(one, curves=[*one.curves, mark]) for one, mark in zip(made, marks, strict=True)]


def _band(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quantiles over twins at each step; NaN where no twin has a reading."""
    seen = np.isfinite(values).any(axis=0)
    low, high = np.full(values.shape[1], np.nan), np.full(values.shape[1], np.nan)
    low[seen], high[seen] = np.nanquantile(values[:, seen], [0.025, 0.975], axis=0)
    return low, high


def _weekends(axes: Axes, residuals: Residuals, begin: float) -> None:
    for day in np.unique(residuals.day[residuals.weekend]):
        axes.axvspan((day * DAY - begin) / DAY, ((day + 1) * DAY - begin) / DAY, color=_WEEKEND, linewidth=0, zorder=0)


def _days_below(axes: Axes, begin: float, zero: np.datetime64 | None) -> None:
    """What the horizontal axis counts, with dates if there is a calendar; ``begin`` [s since ``zero``]."""
    axes.set_xlabel("day of the record", fontsize=9)
    if zero is not None:
        calendar(axes, zero + np.timedelta64(round(begin), "s"))


def _within(axes: Axes, residual: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
    """Limits from the residual and the band's median width: single steps at which the twins are wide say little."""
    wide = float(np.nanmedian(high - low)) if np.isfinite(high - low).any() else 0.0
    seen = residual[np.isfinite(residual)]
    least, most = min(seen.min(initial=0.0), -0.75 * wide), max(seen.max(initial=0.0), 0.75 * wide)
    spare = 0.08 * (most - least) or 1.0
    axes.set_ylim(least - spare, most + spare)


def _frame(axes: Axes, days: np.ndarray, label: str) -> None:
    axes.set_xlim(float(days[0]), float(days[-1]))
    axes.set_ylabel(label, fontsize=8)
    axes.tick_params(labelsize=8)
