"""Figures of a posterior: rank histograms, coverage, and the corner plot of one recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill

import corner
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy import stats

from trainer.figures import save_png
from trainer.posterior.inference import LEVEL, summarise
from trainer.posterior.scores import FEWEST, PER_BIN, bins_for, covered, uniformity

BAND = 0.99
"""Share of the bars, or of the coverages, of a calibrated posterior that lie in the grey band."""
BLUE = "#4477aa"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
DASHES = ("solid", "dashed", "dotted", "dashdot")
"""Lines of a picture: colours that those tell apart who see no red or green (Okabe and Ito, 2008), then dashes."""
INNER = 0.5
SPARE = 0.1
"""So much is left beside the samples of a corner plot, as a share of their range."""


def draw_ranks(position: np.ndarray, parameters: Sequence[str], title: str, path: Path) -> None:
    """Rank histogram of each parameter, from positions (systems, parameters): flat if the posterior is calibrated.

    Of few systems it has too few bars to show that, and the ranks themselves are drawn.
    """
    systems, bins = len(position), bins_for(len(position))
    chi2, kolmogorov = uniformity(position)
    across = min(4, len(parameters))
    down = math.ceil(len(parameters) / across)
    figure = Figure(figsize=(3.2 * across, 2.4 * down + 0.8), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).flatten()
    for k, name in enumerate(parameters):
        axes = panels[k]
        if bins:
            _bars(axes, position[:, k], bins)
            axes.set_title(f"{name}: p {chi2[k]:.2f} (chi2), {kolmogorov[k]:.2f} (KS)", fontsize=9)
        else:
            axes.plot(position[:, k], np.zeros(systems), "|", color=BLUE, markersize=24, markeredgewidth=1)
            axes.set(yticks=[])
            axes.set_title(f"{name}: p {kolmogorov[k]:.2f} (KS)", fontsize=9)
        axes.set(xlim=(0, 1))
        axes.tick_params(labelsize=7)
    for axes in panels[len(parameters) :]:
        axes.set_visible(False)
    figure.supxlabel("rank of the truth among the samples, as a share", fontsize=9)
    few = f"too few systems for a histogram, which takes {FEWEST * PER_BIN}: a line for each"
    said = f"grey: {100 * BAND:g} % of the bars of a calibrated posterior" if bins else few
    if bins:
        figure.supylabel("systems", fontsize=9)
    figure.suptitle(fill(title, round(across * 40)) + "\n" + fill(said, round(across * 40)), fontsize=10)
    save_png(figure, path)


def _bars(axes: Axes, position: np.ndarray, bins: int) -> None:
    """Histogram of positions (systems,) and the band of a calibrated posterior, whose edges are over the bars."""
    low, high = stats.binom.interval(BAND, len(position), 1 / bins)
    axes.axhspan(low, high, color="#dddddd", zorder=0)
    axes.hist(position, bins, range=(0, 1), color=BLUE, edgecolor="white", linewidth=0.5)
    for edge in (low, high):
        axes.axhline(edge, color="#888888", linewidth=0.8)
    axes.axhline(len(position) / bins, color="black", linewidth=0.8, linestyle=":")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set(ylim=(0, None))


def draw_coverage(position: np.ndarray, systems: int, parameters: Sequence[str], title: str, path: Path) -> None:
    """Coverage of central intervals less their level, from positions (windows, parameters) of so many systems."""
    levels = np.linspace(0.02, 0.98, 49)
    figure = Figure(figsize=(7.5, 4.5), layout="constrained")
    axes = figure.subplots()
    ends = np.array(stats.binom.interval(BAND, systems, levels)) / systems - levels
    axes.fill_between(100 * levels, 100 * ends[0], 100 * ends[1], color="#dddddd", label=f"{100 * BAND:g} % band")
    axes.axhline(0, color="black", linewidth=0.8, linestyle=":")
    styles = [(colour, dash) for dash in DASHES for colour in COLOURS]
    for k, name in enumerate(parameters):
        colour, dash = styles[k % len(styles)]
        share = np.array([covered(position[:, k], level).mean() for level in levels])
        axes.plot(100 * levels, 100 * (share - levels), label=name, linewidth=1.2, color=colour, linestyle=dash)
    axes.axvline(100 * LEVEL, color="#888888", linewidth=0.8)
    axes.set(xlabel="central interval [%]", ylabel="coverage less that [percentage points]", xlim=(0, 100))
    axes.set_title(title, fontsize=10)
    figure.legend(loc="outside right center", fontsize=8)
    save_png(figure, path)


def draw_corner(
    samples: np.ndarray, names: Sequence[str], units: Sequence[str], ranges: Sequence[tuple[float, float]], path: Path
) -> None:
    """Marginals and pairs of samples (n, parameters) [own units], over what they reach of the prior ranges.

    Grey lines are ends of the prior ranges, where those are near. Over the whole of them a narrow posterior would fall
    into a bin or two, and be drawn far wider than it is.
    """
    count = len(names)
    shown = [_reached(samples[:, k], ends) for k, ends in enumerate(ranges)]
    said = (
        f"posterior, over what its samples reach; shades hold {100 * INNER:g} and {100 * LEVEL:g} % of them; dashed:"
        f" median and {100 * LEVEL:g} % interval; grey lines: ends of the prior"
    )
    side = 1.9 * count + 0.8
    title = fill(said, round(side / 0.08))
    figure = Figure(figsize=(side, side + 0.3 + 0.17 * len(title.splitlines())))
    corner.corner(
        samples,
        labels=[f"{name}\n[{unit}]" for name, unit in zip(names, units, strict=True)],
        range=shown,
        bins=30,
        smooth=0.8,
        color=BLUE,
        plot_datapoints=False,
        fill_contours=True,
        levels=(INNER, LEVEL),
        label_kwargs={"fontsize": 9},
        max_n_ticks=3,
        fig=figure,
    )
    found = summarise(samples[None])  # not corner's quantiles, so that the lines are those of the table
    for k, axes in enumerate(figure.axes[:: count + 1]):  # the diagonal
        for end in (found.low, found.median, found.high):
            axes.axvline(end[0, k], linestyle="dashed", color=BLUE)
        for bound in ranges[k]:
            if shown[k][0] <= bound <= shown[k][1]:
                axes.axvline(bound, color="#888888", linewidth=2)
        axes.set_title("prior {:.4g} to {:.4g}".format(*ranges[k]), fontsize=8)
    figure.subplots_adjust(top=(side - 0.1) / figure.get_figheight())
    figure.suptitle(title, fontsize=10, y=0.995, va="top")
    save_png(figure, path)


def _reached(values: np.ndarray, ends: tuple[float, float]) -> tuple[float, float]:
    """The range that samples (n,) reach, with something to spare."""
    low, high = float(values.min()), float(values.max())
    spare = SPARE * (high - low) or SPARE * (ends[1] - ends[0])
    return low - spare, high + spare
