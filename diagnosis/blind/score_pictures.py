"""Pictures of a score: confusion, power, reliability, shrinkage and parameters, each with its intervals."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from diagnosis.blind.rates import Figure, Matrix, Point, Reliability, Share
from diagnosis.blind.shrinking import Error, Shrinkage
from diagnosis.curves import BLUE, GREY, ORANGE, RED, embedded

_LEFT = -1.05
"""Least share that the shrinkage picture shows."""
_ROOM = 66
"""Letters under a matrix beyond which they stand upright."""


def _panels(columns: int, width: float, height: float) -> tuple[Drawing, list[Any]]:
    made = Drawing(figsize=(width, height), layout="constrained")
    panels = list(made.subplots(1, columns, squeeze=False)[0])
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
    return made, panels


def confusion(matrix: Matrix, down: str, across: str, *, of: int, missing: str = "") -> str:
    """Rows' truth by columns' answer: shares of each row as colour, numbers as text; right answers are framed.

    ``of`` so many recordings; ``missing`` says which of them are not in the matrix.
    """
    counts = np.array(matrix.counts, dtype=float).reshape(len(matrix.rows), len(matrix.columns))
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    rows, columns = [[_words(name) for name in names] for names in (matrix.rows, matrix.columns)]
    width = min(1.9 + 0.085 * max(map(len, rows), default=0) + 0.45 * len(columns), 13.0)
    long = max((len(name) for name in columns), default=0)
    made, (panel,) = _panels(
        1, max(width, 4.5), 1.1 + (0.075 * long if long * len(columns) > _ROOM else 0.0) + 0.3 * len(rows)
    )
    panel.imshow(shares, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for i, j in np.argwhere(counts > 0):
        colour = "white" if shares[i, j] > 0.55 else "black"
        panel.text(j, i, f"{counts[i, j]:.0f}", ha="center", va="center", fontsize=8, color=colour)
        if matrix.rows[i] == matrix.columns[j]:
            panel.add_patch(_frame(j, i))
    panel.set_xticks(range(len(columns)), columns, rotation=90 if long * len(columns) > _ROOM else 0, fontsize=8)
    panel.set_yticks(range(len(rows)), rows, fontsize=8)
    panel.set_ylabel(down)
    panel.set_xlabel(across)
    panel.tick_params(length=0)
    said = _holds(int(counts.sum()), of, missing) + (" Framed: right." if panel.patches else "")
    made.suptitle(fill(said, round(14 * made.get_figwidth())), fontsize=8)
    return embedded(made)


def _holds(count: int, of: int, missing: str) -> str:
    """How many recordings a matrix holds, which not, and what its colours are."""
    which = f"{count} recordings" if count >= of else f"{count} of {of} recordings, all but {missing}"
    return f"{which}. Colour: share of the row."


def _frame(column: int, row: int) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, edgecolor=ORANGE, lw=1.6)


def _words(name: str) -> str:
    return name.replace("_", " ")


def power(by_size: Sequence[Point], by_gap: Sequence[Point], by_length: Sequence[Point]) -> str:
    """How often a gap is found, and the right effect named first: by amplitude, gap, and length of the gap."""
    labels = (
        "size of the effect,\nin times its usual size",
        "largest gap,\nin times the noise of one reading",
        "what nothing else imitates of the gap,\nin standard deviations of the noise",
    )
    kept = [one for one in zip((by_size, by_gap, by_length), labels, strict=True) if one[0]]
    made, panels = _panels(len(kept), 4.4 * len(kept), 3.4)
    for panel, (points, label) in zip(panels, kept, strict=True):
        ticks = [f"{p.low:g}–{p.high:g}" if p.high is not None else f"over {p.low:g}" for p in points]
        for what, colour, shift in (("found", BLUE, -0.08), ("top", ORANGE, 0.08)):
            shares = [getattr(point, what) for point in points]
            _points(panel, np.arange(len(points)) + shift, shares, colour)
        panel.set_xticks(range(len(points)), [f"{t}\nn = {p.found.n}" for t, p in zip(ticks, points, strict=True)])
        panel.set_xlim(-0.5, len(points) - 0.5)
        panel.tick_params(axis="x", labelsize=8)
        panel.set_xlabel(label)
        panel.set_ylim(-0.03, 1.03)
        panel.grid(axis="y", alpha=0.25)
    panels[0].plot([], [], "o-", color=BLUE, label="a gap is found")
    panels[0].plot([], [], "o-", color=ORANGE, label="the right effect is named first")
    made.legend(fontsize=8, loc="outside upper center", ncols=2, frameon=False)
    panels[0].set_ylabel("share of recordings")
    return embedded(made)


def _points(panel: Any, x: np.ndarray, shares: Sequence[Share | Figure], colour: str) -> None:
    seen = [(at, one) for at, one in zip(x, shares, strict=True) if one.value is not None]
    if not seen:
        return
    value = np.array([one.value for _, one in seen], dtype=float)
    low = np.array([one.low for _, one in seen], dtype=float)
    high = np.array([one.high for _, one in seen], dtype=float)
    errors = np.maximum([value - low, high - value], 0.0)
    panel.errorbar([at for at, _ in seen], value, errors, fmt="o-", color=colour, ms=5, lw=1.2, capsize=2)


def reliability(first: Reliability, every: Reliability) -> str:
    """How often what was said with a probability was so, with 95 % intervals; below, how often it was said."""
    made, panels = _panels(2, 9.0, 4.2)
    titles = ("the most probable answer", "all that was said (1 % and above)")
    for panel, one, title in zip(panels, (first, every), titles, strict=True):
        panel.plot([0, 1], [0, 1], color=GREY, lw=1, ls="--")
        kept = [bin_ for bin_ in one.bins if bin_.said is not None]
        _points(panel, np.array([bin_.said for bin_ in kept]), [bin_.happened for bin_ in kept], BLUE)
        for bin_ in kept:
            panel.text(float(bin_.said or 0.0), -0.09, f"{bin_.happened.n}", ha="center", fontsize=7, color=GREY)
        panel.set_title(title, fontsize=9)
        panel.set_xlim(-0.03, 1.03)
        panel.set_ylim(-0.13, 1.03)
        panel.set_xlabel("probability that was said (numbers: how often)")
        panel.grid(alpha=0.25)
    panels[0].set_ylabel("how often it was so")
    return embedded(made)


def shrinkage(channels: Sequence[Shrinkage]) -> str:
    """Share of the gap that was removed, beside the oracle's."""
    shown = [one for one in channels if one.share.n]
    made, (panel,) = _panels(1, 9.0, 0.9 + 0.5 * max(len(shown), 1))
    for row, one in enumerate(shown):
        _bar(panel, row - 0.12, one.share, BLUE)
        _bar(panel, row + 0.12, one.oracle, GREY)
    panel.set_yticks(range(len(shown)), [f"{one.channel} (n = {one.share.n})" for one in shown], fontsize=8)
    panel.axvline(0.0, color="black", lw=0.6)
    panel.set_xlim(_LEFT, 1.05)
    panel.invert_yaxis()
    panel.set_xlabel("share of the gap removed, mean over recordings (blue); by the oracle (grey)")
    panel.grid(axis="x", alpha=0.25)
    return embedded(made)


def parameters(errors: Sequence[Error]) -> str:
    """Errors of the parameters without and with the named effect."""
    shown = [one for one in errors if one.before.n]
    made, (panel,) = _panels(1, 9.0, 0.9 + 0.36 * max(len(shown), 1))
    for row, one in enumerate(shown):
        _bar(panel, row - 0.12, one.before, RED)
        _bar(panel, row + 0.12, one.after, BLUE)
    panel.set_yticks(range(len(shown)), [one.parameter for one in shown], fontsize=8)
    panel.set_xlim(left=0.0)
    panel.invert_yaxis()
    panel.set_xlabel("mean error as a share of the range: without (red), with the named effect (blue)")
    panel.grid(axis="x", alpha=0.25)
    return embedded(made)


def _bar(panel: Any, row: float, one: Figure, colour: str) -> None:
    if one.value is None:
        return
    if one.low is not None and one.high is not None:
        panel.plot([one.low, one.high], [row, row], color=colour, lw=3, alpha=0.45, solid_capstyle="butt")
    panel.plot(one.value, row, "o", color=colour, ms=6)
