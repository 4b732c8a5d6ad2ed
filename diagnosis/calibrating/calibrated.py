"""A calibration with the fit that it was made from."""

from __future__ import annotations

from dataclasses import dataclass

import xarray as xr

from diagnosis.calibrating.schema import Calibration
from diagnosis.curves import curves
from diagnosis.fitting.fit import Fit
from diagnosis.fitting.problem import Problem


@dataclass(frozen=True)
class Calibrated:
    """A calibration and what it was made from, for whoever goes on: forecasts, pictures, effects."""

    report: Calibration
    fit: Fit

    @property
    def problem(self) -> Problem:
        """The problem as it was fitted in the end."""
        return self.fit.problem

    def curves(self) -> xr.Dataset:
        """What was measured, and the fitted model, over (output, time)."""
        made, record = self.problem, self.problem.recording
        return curves(
            made.time, record.zero, made.system.outputs, measured=made.measured, model=self.fit.around.outputs
        )
