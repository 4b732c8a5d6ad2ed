"""The two figures of ASHRAE Guideline 14, which practice asks for.

They know no noise and no null: reported, not relied on.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

NO_SHARE = ("K", "degC", "degF")
"""Units whose zero is arbitrary or far away: a share of their mean says nothing."""
HOURLY_CVRMSE = 0.30
HOURLY_NMBE = 0.10
"""What Guideline 14 asks of a simulation calibrated to hourly data."""


@dataclass(frozen=True)
class Guideline14:
    """``cvrmse`` and ``nmbe`` as shares, None for temperatures; ``rmse``, ``bias`` (measured less simulated) [unit]."""

    channel: str
    unit: str
    rmse: float
    bias: float
    cvrmse: float | None
    nmbe: float | None
    within: bool | None

    def to_dict(self) -> dict[str, str | float | bool | None]:
        """For ``report.json``."""
        return asdict(self)


def guideline14(channel: str, unit: str, measured: np.ndarray, residual: np.ndarray, fitted: int = 1) -> Guideline14:
    """CVRMSE = sqrt(sum r^2 / (n - p)) / mean, NMBE = sum r / ((n - p) mean), r measured minus simulated.

    Definitions of ASHRAE Guideline 14. A temperature has none: in kelvin 30 % is 90 K, in Celsius it depends on where
    zero was put. Its RMSE and bias are given in its unit.

    Parameters
    ----------
    measured, residual
        Shape (steps,); NaN where missing.
    fitted
        Parameters fitted to the data, p; the guideline takes 1 for calibrated simulations.
    """
    seen = np.isfinite(measured) & np.isfinite(residual)
    n, left = int(seen.sum()), residual[seen]
    if n <= fitted:
        return Guideline14(channel, unit, float("nan"), float("nan"), None, None, None)
    rmse, bias = float(np.sqrt(np.mean(left**2))), float(left.mean())
    mean = float(measured[seen].mean())
    if unit in NO_SHARE or mean == 0:
        return Guideline14(channel, unit, rmse, bias, None, None, None)
    cvrmse = float(np.sqrt(np.sum(left**2) / (n - fitted)) / abs(mean))
    nmbe = float(left.sum() / ((n - fitted) * abs(mean)))
    return Guideline14(channel, unit, rmse, bias, cvrmse, nmbe, cvrmse <= HOURLY_CVRMSE and abs(nmbe) <= HOURLY_NMBE)
