"""The picture of a recording: what was read, what was left out, what was filled."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import matplotlib
import matplotlib.dates
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from diagnosis.importing.clock import Clock
from diagnosis.importing.filling import runs
from diagnosis.importing.series import Series
from diagnosis.pictures import as_png, readable
from shared.flags import ASSUMED, IMPOSSIBLE, INTERPOLATED, STUCK
from shared.variables import ZERO_CELSIUS

matplotlib.use("Agg")

_MARKS = ((IMPOSSIBLE, "x", "impossible, left out"), (STUCK, ".", "stuck, left out"))


def draw_recording(series: Sequence[Series], time: np.ndarray, clock: Clock, title: str) -> bytes:
    """PNG of a recording: a panel for each variable that was measured or computed.

    Parameters
    ----------
    time
        Ends of the steps, shape (steps,) [s of the clock].
    """
    shown = [one for one in series if one.signal is not None]
    figure = Figure(figsize=(13, 1.9 * len(shown) + 0.9), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
    for axes, one in zip(panels, shown, strict=True):
        _panel(axes, one, time, clock)
    locator = matplotlib.dates.AutoDateLocator(minticks=4, maxticks=14)
    panels[-1].xaxis.set_major_locator(locator)
    panels[-1].xaxis.set_major_formatter(matplotlib.dates.ConciseDateFormatter(locator))
    hours = clock.offset / 3600.0
    panels[-1].set_xlabel(f"local standard time (UTC{hours:+g} h, no daylight saving)")
    labels = {text: handle for axes in panels for handle, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    if len(labels) > 1:
        figure.legend(
            list(labels.values()),
            list(labels),
            loc="outside lower center",
            ncols=len(labels),
            fontsize=8,
            frameon=False,
        )
    figure.suptitle(title, fontsize=11)
    return as_png(figure)


def _panel(axes: Axes, one: Series, time: np.ndarray, clock: Clock) -> None:
    _, unit = readable(one.values, one.target.unit)

    def shown(values: np.ndarray) -> np.ndarray:
        return values - ZERO_CELSIUS if unit != one.target.unit else values

    dates = clock.dates(time)
    style: dict[str, Any] = {"drawstyle": "steps-pre"} if one.target.method == "mean" else {}
    if one.second is not None:
        axes.plot(
            dates, shown(one.second), color="#ee7733", linewidth=0.8, label=f"second meter {one.second_name}", **style
        )
    axes.plot(dates, shown(one.values), color="#4477aa", linewidth=1.0, label="recording", **style)
    low, high = axes.get_ylim()
    step = float(time[1] - time[0])
    for k, (a, b) in enumerate(runs(~np.isfinite(one.values))):
        ends = clock.dates(np.array([time[a] - step, time[b - 1]]))
        axes.axvspan(*ends, color="#bbbbbb", alpha=0.5, linewidth=0, label="missing" if k == 0 else None)
    for bit, colour, text in ((INTERPOLATED, "#ccbb44", "interpolated"), (ASSUMED, "#aa3377", "assumed")):
        chosen = (one.flags & bit) > 0
        if chosen.any():
            axes.plot(dates[chosen], shown(one.values[chosen]), ".", color=colour, markersize=3, label=text)
    signal = one.signal
    if signal is not None:
        inside = (signal.middle >= time[0] - step) & (signal.middle <= time[-1])
        for bit, mark, text in _MARKS:
            chosen = inside & ((signal.flags & bit) > 0)
            if chosen.any():
                # what is far off would squeeze the rest: it is marked at the edge of the panel
                values = np.clip(shown(signal.values[chosen]), low, high)
                at = clock.dates(signal.middle[chosen])
                axes.plot(at, values, mark, color="#cc3311", markersize=4, label=text)
    axes.set_ylabel(f"{one.target.name}\n[{unit}]")
    axes.set_title(_from(one.origin), loc="left", fontsize=8, pad=2)
    axes.margins(x=0.005)
    axes.grid(alpha=0.25)


def _from(origin: str) -> str:
    """Where a variable comes from; the unit of a column is the log's, and not that of the axis."""
    column = re.fullmatch(r"(.+) \[(.*)\]", origin)
    return f"from {column[1]} ({column[2]})" if column else origin
