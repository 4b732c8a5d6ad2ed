"""Curves of an answer: what was measured and what models say, output by output, as a Dataset and as a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from diagnosis.pictures import BLUE, GREY, ORANGE, figure, readable
from shared.variables import Output

LABELS = {"measured": "measured", "before": "model", "after": "model with the named effects", "model": "model"}
"""What the curves are called, in the order in which they are drawn; ``low`` and ``high`` are the ends of a band."""
COLOURS = {"measured": GREY, "before": ORANGE, "after": BLUE, "model": ORANGE}


def curves(time: np.ndarray, zero: np.datetime64, outputs: Sequence[Output], **series: np.ndarray | None) -> xr.Dataset:
    """Curves as a Dataset.

    Parameters
    ----------
    time
        Ends of the steps, shape (steps,) [s since ``zero``].
    outputs
        What the rows are.
    series
        By name (see :data:`LABELS`), each (outputs, steps) [unit of each]; None for one that there is not.

    Returns
    -------
    Dataset
        Variables over (output, time), with ``unit`` and ``long_name`` of each output as coordinates.
    """
    stamps = zero.astype("datetime64[ms]") + np.round(np.asarray(time) * 1000).astype("timedelta64[ms]")
    return xr.Dataset(
        {name: (("output", "time"), values) for name, values in series.items() if values is not None},
        coords={
            "output": [one.name for one in outputs],
            "time": stamps.astype("datetime64[ns]"),
            "unit": ("output", [one.unit for one in outputs]),
            "long_name": ("output", [one.long_name or one.name for one in outputs]),
        },
    )


def shown(drawn: xr.Dataset) -> list[tuple[str, str, dict[str, np.ndarray]]]:
    """For each output that was measured or modelled: its name in words, the unit people read, and its curves in it."""
    found = []
    for name in drawn["output"].values:
        one = drawn.sel(output=name)
        values = {str(key): np.asarray(one[key].values, dtype=float) for key in drawn.data_vars}
        if not any(np.isfinite(value).any() for value in values.values()):
            continue
        unit = str(one["unit"].values)
        values = {key: readable(value, unit)[0] for key, value in values.items()}
        _, read_in = readable(np.asarray(one[next(iter(drawn.data_vars))].values, dtype=float), unit)
        found.append((str(one["long_name"].values), read_in, values))
    return found


def plot(drawn: xr.Dataset) -> Figure:
    """A panel for each output: measured, models, and the band where there is one."""
    rows = shown(drawn)
    made, panels = figure(max(len(rows), 1), height=2.0)
    time = drawn["time"].values
    for panel, (words, unit, values) in zip(panels, rows, strict=False):
        if {"low", "high"} <= values.keys():
            panel.fill_between(time, values["low"], values["high"], color=ORANGE, alpha=0.2, lw=0, label="90 % band")
        for key, label in LABELS.items():
            if key in values:
                style = {"ls": "", "marker": ".", "ms": 2.5} if key == "measured" else {"lw": 1.1}
                panel.plot(time, values[key], color=COLOURS[key], label=label, **style)
        panel.set_ylabel(f"{words}\n[{unit}]", fontsize=8)
    if rows:
        panels[0].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=4, fontsize=8, frameon=False)
    return made
