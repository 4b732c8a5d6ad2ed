"""A forecast and all that is told of it: ``forecast.json`` and its curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from pydantic import BaseModel, ConfigDict

from diagnosis.calibrating.schema import Calibration
from diagnosis.curves import curves, plot
from diagnosis.physics import Finding
from diagnosis.scores import Score
from shared.results import Result
from shared.system import System


class Ahead(Score):
    """Scores of one output's forecast, and the share of readings within its band."""

    covered: float


class Forecast(BaseModel):
    """``forecast.json``. Scores are None where nothing was measured ahead; ``begin`` is that of the context.

    ``draws`` made the bands; ``failed`` more could not be simulated, and for others the time was up (``stopped``).
    ``physics``: what in the recording cannot be, or contradicts the description.
    """

    model_config = ConfigDict(extra="forbid")
    schema_version: int = 4
    system: str
    recording: str
    begin: str
    context_hours: float
    ahead_hours: float
    level: float
    draws: int
    failed: int
    stopped: bool = False
    occupancy: str
    calibration: Calibration
    physics: list[Finding] = []
    outputs: dict[str, Ahead | None]


@dataclass(frozen=True, repr=False)
class Forecasted(Result):
    """A forecast and its curves.

    ``time`` (steps,) [s]; ``measured``, ``centre``, ``low``, ``high`` (outputs, steps) [unit of each] over context and
    forecast; ``context`` steps belong to the context. ``given``: the parameters are those of a calibration made before,
    not of one on the context.
    """

    report: Forecast
    system: System
    time: np.ndarray
    measured: np.ndarray
    centre: np.ndarray
    low: np.ndarray
    high: np.ndarray
    context: int
    given: bool

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        report = self.report
        ahead = f"{report.ahead_hours:g} h after {report.context_hours:g} h of {report.recording}"
        return f"{report.system}, {len(report.outputs)} outputs, {ahead}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each output and time: measured, forecast, the ends of the 90 % band, and whether it was ahead."""
        table = self.curves().drop_vars(["unit", "long_name"]).to_dataframe()
        ahead = np.arange(len(self.time)) >= self.context
        return table.assign(ahead=np.tile(ahead, len(self.measured)))

    def plot(self) -> Figure:
        """Measured, forecast and its band, output by output."""
        return plot(self.curves())

    def curves(self) -> xr.Dataset:
        """What was measured, the forecast and its band, over (output, time): the first ``context`` steps are fitted."""
        begin = float(2 * self.time[0] - self.time[1])  # a stamp is the end of its step
        zero = np.datetime64(self.report.begin.replace(" ", "T"), "ms") - np.timedelta64(round(begin * 1000), "ms")
        band = {"low": self.low, "high": self.high}
        return curves(self.time, zero, self.system.outputs, measured=self.measured, model=self.centre, **band)


def about_failed(draws: int, failed: int) -> str:
    """What is said of draws that could not be simulated, beside those that were."""
    return f"{failed} of {draws + failed} simulations behind the bands failed; the bands are those of the others"
