"""Figures of a run: the loss curve, and the estimates against the truth (paper, figure 4)."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from shared.store import write_atomically

matplotlib.use("Agg")

COLOURS = {"paper": "#4477aa", "unseen": "#cc3311"}
MARKERS = {"paper": "o", "unseen": "x"}


def save_png(figure: Figure, path: Path) -> None:
    """Write a figure whole."""
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=150)
    write_atomically(path, data.getvalue())


def draw_loss_curve(rows: Sequence[tuple[int, float, float, float]], title: str, path: Path) -> None:
    """Training and validation loss against steps; rows are (step, seconds, training, validation)."""
    step, _, training, validation = np.array(rows).T
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(step, training, color="#888888", label="training")
    axes.plot(step, validation, color=COLOURS["unseen"], label="validation systems")
    best = int(np.nanargmin(validation))
    axes.plot(step[best], validation[best], "o", color=COLOURS["unseen"], label=f"kept: step {step[best]:g}")
    axes.axhline(1.0, color="black", linewidth=0.8, linestyle=":", label="predict the mean")
    axes.set(xlabel="step", ylabel="mean squared error of standardised log10", title=title, yscale="log")
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

    Parameters
    ----------
    clouds
        For each protocol: truth and estimate, both (windows, parameters), and R2 (parameters,).
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
