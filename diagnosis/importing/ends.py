"""Which input ends a recording that goes on as long as all inputs do, and why: a forecast of another spacing, often."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from diagnosis.importing.quality import Signal
from diagnosis.importing.series import Series
from diagnosis.importing.spacing import usual_gap


def about_ends(series: Sequence[Series], edges: np.ndarray, last: int) -> list[str]:
    """Sentences on inputs without a value in step ``last`` of the grid, where inputs were read beyond it.

    Parameters
    ----------
    edges
        Of the steps, shape (steps + 1,) [s].
    """
    read = [(one, one.signal.clean()) for one in series if one.target.role == "input" and one.signal is not None]
    if last + 1 >= len(edges) or not any((signal.middle > edges[last + 1]).any() for _, signal in read):
        return []
    return [
        f"{one.target.name}, {one.origin}, has no value in the step after, and so the recording ends there"
        f"{_spacing(signal, float(edges[last]))}"
        for one, signal in read
        if not np.isfinite(one.values[last])
    ]


def _spacing(signal: Signal, end: float) -> str:
    """How far apart readings are after ``end`` [s], where that is so much further than usual that it leaves gaps."""
    middle, length = signal.middle, signal.end - signal.begin
    after = middle > end
    if after.sum() < 2:
        return ""
    usual, apart = float(np.median(np.diff(middle))), float(np.median(np.diff(middle[after])))
    if apart <= usual_gap(usual) or np.median(length[after]) >= apart:
        return ""
    field = f"interval = {apart:g}" if signal.kind == "mean" else f"max_gap = {apart / 3600:.3g}"
    return (
        f": its readings are {apart:g} s apart from there on, and usually {usual:g} s; expected the same spacing"
        f" throughout, or {field}"
    )
