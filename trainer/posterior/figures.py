"""Figures of a posterior: rank histograms, coverage, and the corner plot of one recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import corner
import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from trainer.figures import save_png
from trainer.posterior.inference import LEVEL, summarise
from trainer.posterior.scores import bins_for, covered, uniformity

BAND = 0.99
"""Share of the bars, or of the coverages, of a calibrated posterior that lie in the grey band."""
BLUE = "#4477aa"


def draw_ranks(position: np.ndarray, parameters: Sequence[str], title: str, path: Path) -> None:
    """Rank histogram of each parameter, from positions (systems, parameters): flat if the posterior is calibrated."""
    systems, bins = len(position), bins_for(len(position))
    low, high = stats.binom.interval(BAND, systems, 1 / bins)
    chi2, kolmogorov = uniformity(position)
    across = min(4, len(parameters))
    down = math.ceil(len(parameters) / across)
    figure = Figure(figsize=(3.2 * across, 2.4 * down + 0.8), layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).flatten()
    for k, name in enumerate(parameters):
        axes = panels[k]
        axes.axhspan(low, high, color="#dddddd", zorder=0)
        axes.axhline(systems / bins, color="black", linewidth=0.8, linestyle=":")
        axes.hist(position[:, k], bins, range=(0, 1), color=BLUE, edgecolor="white", linewidth=0.5)
        axes.set_title(f"{name}: p {chi2[k]:.2f} (chi2), {kolmogorov[k]:.2f} (KS)", fontsize=9)
        axes.set(xlim=(0, 1), ylim=(0, None))
        axes.tick_params(labelsize=7)
    for axes in panels[len(parameters) :]:
        axes.set_visible(False)
    figure.supxlabel("rank of the truth among the samples, as a share", fontsize=9)
    figure.supylabel("systems", fontsize=9)
    figure.suptitle(f"{title}\ngrey: {100 * BAND:g} % of the bars of a calibrated posterior", fontsize=10)
    save_png(figure, path)


def draw_coverage(position: np.ndarray, systems: int, parameters: Sequence[str], title: str, path: Path) -> None:
    """Coverage of central intervals less their level, from positions (windows, parameters) of so many systems."""
    levels = np.linspace(0.02, 0.98, 49)
    figure = Figure(figsize=(7.5, 4.5), layout="constrained")
    axes = figure.subplots()
    ends = np.array(stats.binom.interval(BAND, systems, levels)) / systems - levels
    axes.fill_between(100 * levels, 100 * ends[0], 100 * ends[1], color="#dddddd", label=f"{100 * BAND:g} % band")
    axes.axhline(0, color="black", linewidth=0.8, linestyle=":")
    for k, name in enumerate(parameters):
        share = np.array([covered(position[:, k], level).mean() for level in levels])
        axes.plot(100 * levels, 100 * (share - levels), label=name, linewidth=1.2)
    axes.axvline(100 * LEVEL, color="#888888", linewidth=0.8)
    axes.set(xlabel="central interval [%]", ylabel="coverage less that [percentage points]", xlim=(0, 100))
    axes.set_title(title, fontsize=10)
    figure.legend(loc="outside right center", fontsize=8)
    save_png(figure, path)


def draw_corner(
    samples: np.ndarray, names: Sequence[str], units: Sequence[str], ranges: Sequence[tuple[float, float]], path: Path
) -> None:
    """Marginals and pairs of samples (n, parameters) [own units], over the whole prior ranges."""
    count = len(names)
    figure = Figure(figsize=(1.9 * count + 0.8, 1.9 * count + 0.8))
    corner.corner(
        samples,
        labels=[f"{name}\n[{unit}]" for name, unit in zip(names, units, strict=True)],
        range=list(ranges),
        bins=30,
        smooth=0.8,
        color=BLUE,
        plot_datapoints=False,
        fill_contours=True,
        levels=(0.5, LEVEL),
        label_kwargs={"fontsize": 9},
        max_n_ticks=3,
        fig=figure,
    )
    found = summarise(samples[None])  # not corner's quantiles, so that the lines are those of the table
    for k, axes in enumerate(figure.axes[:: count + 1]):  # the diagonal
        for end in (found.low, found.median, found.high):
            axes.axvline(end[0, k], linestyle="dashed", color=BLUE)
    figure.suptitle(f"posterior over the prior's ranges; dashed: median and {100 * LEVEL:g} % interval", fontsize=10)
    save_png(figure, path)
