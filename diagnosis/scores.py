"""How far a simulation is from a measurement, output by output (ASHRAE Guideline 14-2014, section 5.2.11)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import BaseModel, ConfigDict
from rich.table import Table

TEMPERATURES = ("K", "degC", "degF")
"""Units whose zero is arbitrary or far away: a share of their mean says nothing."""


class Score(BaseModel):
    """One output.

    ``rmse`` and ``bias`` (measured minus simulated) in ``unit``; ``cvrmse`` and ``nmbe`` are shares of the yardstick
    that ``share_of`` names: the mean, or for a temperature the range of the measurement.
    """

    model_config = ConfigDict(extra="forbid")
    unit: str
    steps: int
    rmse: float
    bias: float
    cvrmse: float | None
    nmbe: float | None
    share_of: str


def score(measured: np.ndarray, simulated: np.ndarray, unit: str) -> Score:
    """Compare a measured with a simulated series, each (steps,) [unit], where something was measured.

    A mean above absolute zero is no yardstick for a temperature, and one above 0 degC depends on the scale. Its errors
    are therefore shares of its range: from the 2.5 % to the 97.5 % quantile of what was measured.
    """
    seen = np.isfinite(measured)
    left = measured[seen] - simulated[seen]
    if unit in TEMPERATURES:
        low, high = np.quantile(measured[seen], [0.025, 0.975])
        yardstick, share_of = float(high - low), "95 % range"
    else:
        yardstick, share_of = abs(float(measured[seen].mean())), "mean"
    rmse, bias = float(np.sqrt(np.mean(left**2))), float(left.mean())
    return Score(
        unit=unit,
        steps=int(seen.sum()),
        rmse=rmse,
        bias=bias,
        cvrmse=rmse / yardstick if yardstick > 0 else None,
        nmbe=bias / yardstick if yardstick > 0 else None,
        share_of=share_of,
    )


def score_table(outputs: Mapping[str, Score], **further: Mapping[str, float]) -> Table:
    """Scores by output, for the terminal, with further columns of shares by output."""
    heads = ("output", "unit", "RMSE", "bias", "CVRMSE", "NMBE", "shares of")
    table = Table(*heads, *(head.replace("_", " ") for head in further), box=None)
    for name, one in outputs.items():
        shares = ["-" if value is None else f"{value:.2%}" for value in (one.cvrmse, one.nmbe)]
        more = [f"{column[name]:.0%}" for column in further.values()]
        table.add_row(name, one.unit, f"{one.rmse:.4g}", f"{one.bias:.4g}", *shares, one.share_of, *more)
    return table
