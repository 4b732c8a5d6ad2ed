"""Figures: the loss curve, estimates against the truth (paper, figure 4), and those of the benchmark."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

from shared.store import write_atomically

COLOURS = {"paper": "#4477aa", "unseen": "#cc3311"}
MARKERS = {"paper": "o", "unseen": "x"}
WITHIN = 10.0
"""A logarithmic axis whose ends are apart by less than this factor has plain numbers in place of powers of ten."""


class Picture(Figure):
    """A figure that notebooks show, whether or not they have loaded ``matplotlib.pyplot``."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png")
        return buffer.getvalue()


def save_png(figure: Figure, path: Path) -> None:
    """Write a figure whole, names in it as they stand: between two dollars matplotlib would read a formula.

    Its own formulas are the labels of logarithmic axes.
    """
    for text in figure.findobj(Text):
        text.set_parse_math(False)
    for axes in figure.axes:
        for axis, scale in ((axes.xaxis, axes.get_xscale()), (axes.yaxis, axes.get_yscale())):
            for label in axis.get_ticklabels(which="both") if scale == "log" else ():
                label.set_parse_math(True)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=150)
    write_atomically(path, data.getvalue())


def draw_estimates(table: pd.DataFrame) -> Picture:
    """A panel for each parameter of :meth:`trainer.predicting.prediction.Predictions.to_dataframe`.

    A point is the median and a bar its 90 % interval, where there is a posterior; else the estimate with its rmse.
    """
    names = list(dict.fromkeys(table.index.get_level_values("parameter")))
    figure = Picture(figsize=(8, 0.9 * len(names) + 0.5), layout="constrained")
    for axes, name in zip(np.atleast_1d(figure.subplots(len(names), 1)), names, strict=True):
        rows = table[table.index.get_level_values("parameter") == name]
        posterior = bool(rows["median"].notna().all())
        middle = rows["median" if posterior else "value"].to_numpy(dtype=float)
        wide = rows["rmse"].to_numpy(dtype=float)
        low = rows["low"].to_numpy(dtype=float) if posterior else middle - wide
        high = rows["high"].to_numpy(dtype=float) if posterior else middle + wide
        place = np.arange(len(rows))
        axes.hlines(place, low, high, color=COLOURS["paper"], lw=3)
        axes.plot(middle, place, "o", color=COLOURS["paper"])
        axes.set(yticks=[], ylim=(-0.8, len(rows) - 0.2))
        unit = rows["unit"].iloc[0]
        axes.set_title(name if unit == "1" else f"{name} [{unit}]", loc="left", fontsize=8)
        axes.spines[["top", "right", "left"]].set_visible(False)
    return figure


def draw_r2(table: pd.DataFrame) -> Picture:
    """R2 by parameter, of :meth:`trainer.evaluating.report.Evaluation.to_dataframe`."""
    names = list(dict.fromkeys(table.index.get_level_values("parameter")))
    protocols = list(dict.fromkeys(table.index.get_level_values("protocol")))
    figure = Picture(figsize=(8, 0.4 * len(names) + 1.2), layout="constrained")
    axes = figure.subplots()
    for k, protocol in enumerate(protocols):
        rows = table.xs(protocol, level="protocol").loc[names].astype(float)
        place = np.arange(len(names)) + 0.25 * (k - 0.5 * (len(protocols) - 1))
        colour = COLOURS.get(protocol, "#444444")
        axes.hlines(place, rows["low"], rows["high"], color=colour, lw=2)
        axes.plot(rows["r2"], place, MARKERS.get(protocol, "o"), color=colour, label=protocol)
    limits = table.xs(protocols[0], level="protocol").loc[names, "ceiling"].astype(float)
    axes.plot(limits, np.arange(len(names)), "|", ms=14, color="black", label="ceiling")
    axes.set_yticks(np.arange(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel("R2")
    axes.legend(fontsize=8)
    return figure


def draw_loss_curve(
    rows: Sequence[tuple[int, float, float, float]], title: str, path: Path, kept: int, mean: float | None
) -> None:
    """Training and validation loss against steps; rows are (step, seconds, training, validation), ``kept`` a step.

    ``mean`` is the validation loss of the mean, where it is known.
    """
    step, _, training, validation = np.array(rows).T
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(step, training, color="#888888", label="training")
    axes.plot(step, validation, color=COLOURS["unseen"], label="validation systems")
    best = int(np.argmin(np.abs(step - kept)))
    axes.plot(step[best], validation[best], "o", color=COLOURS["unseen"], label=f"kept: step {step[best]:g}")
    if mean is not None:
        axes.axhline(mean, color="black", linewidth=0.8, linestyle=":", label="predict the mean")
    axes.set(xlabel="step", ylabel="mean squared error of standardised log10", title=title, yscale="log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    low, high = axes.get_ylim()
    if high < WITHIN * low:  # matplotlib would label a power of ten, if there is one at all
        axes.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_locator(NullLocator())
    axes.legend()
    save_png(figure, path)


def draw_scatter(
    clouds: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]],
    parameters: Sequence[str],
    units: Sequence[str],
    title: str,
    path: Path,
) -> None:
    """Estimate against truth of each parameter.

    ``clouds`` are, for each protocol, truth and estimate, both (windows, parameters), and R2 (parameters,).
    """
    across = min(4, len(parameters))
    down = math.ceil(len(parameters) / across)
    figure = Figure(figsize=(3.2 * across, 3.1 * down + 0.5), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).flatten()
    for k, (parameter, unit) in enumerate(zip(parameters, units, strict=True)):
        axes = panels[k]
        for name, (truth, estimate, r2) in clouds.items():
            axes.plot(
                truth[:, k],
                estimate[:, k],
                MARKERS.get(name, "."),
                color=COLOURS.get(name),
                markersize=3,
                alpha=0.5,
                markeredgewidth=0.8,
                label=f"{name}: R2 {r2[k]:.3f}",
                rasterized=True,
            )
        low = min(float(truth[:, k].min()) for truth, _, _ in clouds.values())
        high = max(float(truth[:, k].max()) for truth, _, _ in clouds.values())
        axes.plot([low, high], [low, high], color="black", linewidth=1)
        axes.set_title(parameter, fontsize=10)
        axes.set_xlabel(f"true [{unit}]", fontsize=8)
        axes.set_ylabel(f"estimated [{unit}]", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.legend(fontsize=7, loc="upper left", markerscale=2)
    for axes in panels[len(parameters) :]:
        axes.set_visible(False)
    figure.suptitle(title)
    save_png(figure, path)


class Point(NamedTuple):
    """A score and its interval."""

    value: float
    low: float
    high: float


Line = tuple[str, Mapping[str, Point], float | None]
"""A label, a point for each protocol, and the ceiling."""

FLOOR = -0.5
"""Scores below this are drawn here: how far below zero says nothing more."""


def draw_scores(lines: Sequence[Line], title: str, path: Path) -> None:
    """Mean R2 of each line under every protocol, with its interval, and the ceiling."""
    figure = Figure(figsize=(8, 1.6 + 0.34 * len(lines)), layout="constrained")
    axes = figure.subplots()
    height = np.arange(len(lines))[::-1].astype(float)
    for k, name in enumerate(lines[0][1]):
        shifted = height + 0.12 * (1 - 2 * k)
        _points(axes, [points[name] for _, points, _ in lines], shifted, name)
    limits = [(limit, y) for (_, _, limit), y in zip(lines, height, strict=True) if limit is not None]
    if limits:
        x, y = np.array(limits).T
        axes.plot(x, y, "|", color="black", markersize=14, markeredgewidth=2, label="ceiling")
    axes.axvline(0, color="black", linewidth=0.8, linestyle=":")
    axes.set_yticks(height, [label for label, _, _ in lines], fontsize=8)
    axes.set(xlabel=f"mean R2 over the parameters ({FLOOR:g}: or less)", title=title, xlim=(FLOOR - 0.03, 1.03))
    figure.legend(fontsize=8, loc="outside lower center", ncols=3)
    save_png(figure, path)


def _points(axes: Axes, points: Sequence[Point], height: np.ndarray, name: str) -> None:
    value, low, high = np.clip(np.array(points), FLOOR, None).T
    spread = [np.maximum(value - low, 0), np.maximum(high - value, 0)]
    marker, colour = MARKERS.get(name, "."), COLOURS.get(name)
    axes.errorbar(value, height, xerr=spread, fmt=marker, color=colour, markersize=5, capsize=2, label=name)


def draw_series(
    series: Mapping[tuple[str, str], Sequence[tuple[float, Point]]],
    label: str,
    title: str,
    limit: float | None,
    path: Path,
) -> None:
    """Mean R2 against a quantity, logarithmic, for each (estimator, protocol)."""
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    styles = ["-", "--", ":", "-."]
    models = list(dict.fromkeys(model for model, _ in series))
    for (model, protocol), points in series.items():
        x = np.array([at for at, _ in points])
        value, low, high = np.clip(np.array([point for _, point in points]), FLOOR, None).T
        style, colour = styles[models.index(model) % len(styles)], COLOURS.get(protocol)
        axes.plot(x, value, style, marker=MARKERS.get(protocol, "."), color=colour, label=f"{model}, {protocol}")
        axes.fill_between(x, low, high, color=colour, alpha=0.08)
    if limit is not None:
        axes.axhline(limit, color="black", linewidth=1, label="ceiling")
    axes.axhline(0, color="black", linewidth=0.8, linestyle=":")
    axes.set(xscale="log", xlabel=label, ylabel="mean R2 over the parameters", title=title, ylim=(FLOOR - 0.03, 1.03))
    axes.legend(fontsize=8)
    save_png(figure, path)


def draw_accuracy(
    boxes: Mapping[str, Sequence[tuple[str, np.ndarray]]], parameters: Sequence[str], title: str, path: Path
) -> None:
    """Boxes of relative accuracy against context, a panel for each parameter (paper, figure 5).

    ``boxes`` are, for each protocol, pairs of a label and the relative accuracy (windows, parameters).
    """
    across = min(4, len(parameters))
    down = math.ceil(len(parameters) / across)
    figure = Figure(figsize=(3.4 * across, 2.8 * down + 0.5), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).flatten()
    width = 0.8 / len(boxes)
    for k, parameter in enumerate(parameters):
        axes = panels[k]
        for which, (name, pairs) in enumerate(boxes.items()):
            place = np.arange(len(pairs)) + (which - (len(boxes) - 1) / 2) * width
            drawn = axes.boxplot(
                [values[:, k] for _, values in pairs],
                positions=place,
                widths=0.9 * width,
                showfliers=False,
                manage_ticks=False,
                patch_artist=True,
                medianprops={"color": "black"},
            )
            for box in drawn["boxes"]:
                box.set(facecolor=COLOURS.get(name, "#999999"), alpha=0.6)
            drawn["boxes"][0].set_label(name)
        labels = [label for label, _ in next(iter(boxes.values()))]
        axes.set_xticks(np.arange(len(labels)), labels)
        axes.axhline(1.0, color="black", linewidth=0.8, linestyle=":")
        axes.set_title(parameter, fontsize=10)
        axes.set_xlabel("context [h]", fontsize=8)
        axes.set_ylabel("relative accuracy", fontsize=8)
        axes.tick_params(labelsize=7)
    panels[0].legend(fontsize=7)
    for axes in panels[len(parameters) :]:
        axes.set_visible(False)
    figure.suptitle(title)
    save_png(figure, path)
