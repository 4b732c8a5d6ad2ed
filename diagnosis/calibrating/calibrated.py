"""A calibration with the fit that it was made from."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from diagnosis.calibrating.schema import Calibration
from diagnosis.curves import curves, plot
from diagnosis.fitting.fit import Fit
from diagnosis.fitting.problem import Problem
from diagnosis.recording import DAY
from shared.results import Result


@dataclass(frozen=True, repr=False)
class Calibrated(Result):
    """A calibration and what it was made from, for whoever goes on: forecasts, pictures, effects."""

    report: Calibration
    fit: Fit

    @property
    def problem(self) -> Problem:
        """The problem as it was fitted in the end."""
        return self.fit.problem

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        report = self.report
        days = report.steps * report.step / DAY
        return f"{report.system}, {len(report.parameters)} parameters from {days:.3g} days of {report.recording}"

    def to_dataframe(self) -> pd.DataFrame:
        """A row for each parameter: value, the ends of its 90 % interval, and what the recording told of it."""
        kept = ["description", "unit", "value", "low", "high", "told", "identified", "at_bound", "zero_shot"]
        rows = [{name: getattr(one, name) for name in ("name", *kept)} for one in self.report.parameters]
        return pd.DataFrame(rows).set_index("name")

    def plot(self) -> Figure:
        """Measured and fitted, output by output."""
        return plot(self.curves())

    def curves(self) -> xr.Dataset:
        """What was measured, and the fitted model, over (output, time)."""
        made, record = self.problem, self.problem.recording
        return curves(
            made.time, record.zero, made.system.outputs, measured=made.measured, model=self.fit.around.outputs
        )
