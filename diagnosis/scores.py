"""How far a simulation is from a measurement, output by output, with the two figures of ASHRAE Guideline 14-2014.

Practice asks for those (section 5.2.11). They know no noise and no null: reported, not relied on.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydantic import BaseModel, ConfigDict
from rich.table import Table

from shared.units import TEMPERATURES, spelled


class Score(BaseModel):
    """One output.

    ``rmse`` and ``bias`` (measured minus simulated) in ``unit``; ``cvrmse`` and ``nmbe`` are those of :func:`shares`.
    """

    model_config = ConfigDict(extra="forbid")
    unit: str
    steps: int
    rmse: float
    bias: float
    cvrmse: float | None
    nmbe: float | None


def shares(measured: np.ndarray, residual: np.ndarray, unit: str) -> tuple[float, float] | tuple[None, None]:
    """CVRMSE = sqrt(sum r^2 / (n - 1)) / mean, NMBE = sum r / ((n - 1) mean), r measured minus simulated.

    Definitions of ASHRAE Guideline 14. A temperature has none: in kelvin 30 % is 90 K, in Celsius it depends on where
    zero was put. Nor has what is zero on average, or was read once.

    Parameters
    ----------
    measured, residual
        Shape (n,) [unit].
    """
    count = len(measured) - 1
    mean = abs(float(measured.mean())) if count > 0 else 0.0
    # the zero of a temperature is arbitrary or far away: a share of its mean says nothing
    if spelled(unit) in TEMPERATURES or mean == 0:
        return None, None
    return float(np.sqrt(np.sum(residual**2) / count) / mean), float(residual.sum() / (count * mean))


def score(measured: np.ndarray, simulated: np.ndarray, unit: str) -> Score:
    """Compare a measured with a simulated series, each (steps,) [unit], where something was measured."""
    seen = np.isfinite(measured)
    left = measured[seen] - simulated[seen]
    cvrmse, nmbe = shares(measured[seen], left, unit)
    return Score(
        unit=unit,
        steps=int(seen.sum()),
        rmse=float(np.sqrt(np.mean(left**2))),
        bias=float(left.mean()),
        cvrmse=cvrmse,
        nmbe=nmbe,
    )


def score_table(outputs: Mapping[str, Score], **further: Mapping[str, float]) -> Table:
    """Scores by output, for the terminal, with further columns of shares by output."""
    heads = ("output", "unit", "RMSE", "bias", "CVRMSE", "NMBE")
    table = Table(*heads, *(head.replace("_", " ") for head in further), box=None)
    for name, one in outputs.items():
        figures = ["-" if value is None else f"{value:.2%}" for value in (one.cvrmse, one.nmbe)]
        more = [f"{column[name]:.0%}" for column in further.values()]
        table.add_row(name, one.unit, f"{one.rmse:.4g}", f"{one.bias:.4g}", *figures, *more)
    return table
