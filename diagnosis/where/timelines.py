"""Pictures along time: the residual with its episodes, and the sources that would close it."""

from __future__ import annotations

from collections.abc import Collection
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagnosis.pictures import calendar
from diagnosis.where.episodes import REST, EpisodeTest
from diagnosis.where.ink import MEASURED, QUIET, TWINS, few_digits
from diagnosis.where.series import DAY, Residuals
from diagnosis.where.source import SourceTest, Verdict
from shared.numbers import number
from shared.variables import spaced

_WIDTH = 150
"""So many letters of a title fit above a panel."""
_ROWS, _LABEL = 5, 0.13
"""Heights at which labels of stretches stand at least, and the height of one, as a share of the panel's."""
_SPAN = "#ee9944"


def draw_episodes(
    residuals: Residuals, found: EpisodeTest, *, alpha: float = 0.05, zero: np.datetime64 | None = None
) -> Figure:
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
            if one.channel == residuals.names[k] and one.p_value <= alpha
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


def draw_sources(
    residuals: Residuals,
    found: SourceTest,
    *,
    alpha: float = 0.05,
    answered: Collection[Verdict] = (),
    zero: np.datetime64 | None = None,
) -> Figure:
    """Each source that would close the residual, its uncertainty, and what replicates without a gap would ask for.

    ``answered``: see :meth:`~diagnosis.where.source.SourceTest.words`. ``zero`` is the date from which time runs.
    """
    figure = Figure(figsize=(12.5, 2.5 * len(found.sources) + 1.1), layout="constrained")
    panels = figure.subplots(len(found.sources), 1, squeeze=False, sharex=True)[:, 0]
    begin = float(residuals.time[0] - residuals.step)
    labels = dict(zip(residuals.names, residuals.labels, strict=True))
    for axes, one in zip(panels, found.sources, strict=True):
        peak = float(np.abs(one.estimate).max())
        factor, unit = few_digits(one.unit, max(peak, float(np.abs(one.high).max())))
        edges = (one.edges - begin) / DAY
        centres = (edges[1:] + edges[:-1]) / 2
        axes.fill_between(
            centres, factor * one.low, factor * one.high, step="mid", color=TWINS, alpha=0.8, linewidth=0,
            label="95 % of replicates without a gap",
        )  # fmt: skip
        for sign in (-2, 2):
            edge = factor * (one.estimate + sign * one.uncertainty)
            axes.step(centres, edge, where="mid", color=QUIET, linewidth=0.5, alpha=0.7)
        axes.step(
            centres, factor * one.estimate, where="mid", color=QUIET, linewidth=1.2,
            label="this recording, and two standard deviations either side",
        )  # fmt: skip
        # a pulse may stand out at another smoothness than the one drawn: mark it only where the drawing agrees
        outside = (one.estimate > one.high) | (one.estimate < one.low)
        sure = (one.adjusted <= alpha) & outside & (np.abs(one.estimate) > 2 * one.uncertainty)
        if sure.any():
            marked = np.where(sure, factor * one.estimate, np.nan)
            axes.plot(
                centres,
                marked,
                ".",
                color=MEASURED,
                markersize=4,
                label=f"beyond what replicates show anywhere (p <= {alpha:g})",
            )
        axes.axhline(0, color="black", linewidth=0.6)
        _weekends(axes, residuals, begin)
        _frame(axes, edges, f"{one.label}\n[{unit}]")
        said = (
            f"{one.label} {found.words(one, labels[one.rival], alpha, answered=answered)}"
            f" (p = {one.p_value:.2g}, roughness {one.roughness:.1f}: 0 smooth, 2 noise, 4 spikes)"
        )
        axes.set_title(fill(said, _WIDTH), fontsize=9, loc="left")
    _days_below(panels[-1], begin, zero)
    handles = {text: handle for axes in panels for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.suptitle(
        "What source would close the gap\nAbove zero: the building gains what the model lacks; below: it loses it.",
        fontsize=10,
    )
    return figure


def _band(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quantiles over twins at each step; NaN where no twin has a reading."""
    seen = np.isfinite(values).any(axis=0)
    low, high = np.full(values.shape[1], np.nan), np.full(values.shape[1], np.nan)
    low[seen], high[seen] = np.nanquantile(values[:, seen], [0.025, 0.975], axis=0)
    return low, high


def _weekends(axes: Axes, residuals: Residuals, begin: float) -> None:
    for day in np.unique(residuals.day[residuals.weekend]):
        axes.axvspan((day * DAY - begin) / DAY, ((day + 1) * DAY - begin) / DAY, color="#f3efe0", linewidth=0, zorder=0)


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
