"""Residuals of the recording on top of those of its twins: what every test of this package reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from shared.errors import RecordingError

HOUR = 3600.0
DAY = 24 * HOUR
FEWEST = 4
"""Steps of the shortest recording that can be looked at."""


@dataclass(frozen=True)
class Residuals:
    """Measured minus simulated outputs of the calibrated model, and the same of its twins.

    The twins are the null: the whole pipeline (simulate, add noise, calibrate, subtract) run on recordings that the
    model itself made. They must have been recalibrated: residuals at the true parameters are wider and smoother.

    Parameters
    ----------
    time
        Ends of the steps [s since time zero of the year, local standard time], shape (steps,), regular.
    observed
        Residuals of the recording [unit of each output], shape (outputs, steps); NaN where nothing was measured.
    replicates
        Residuals of the twins, shape (B, outputs, steps); NaN where a twin's reading was lost.
    names, units, labels
        Of the outputs; ``labels`` are what a reader sees (the names, when left out).
    """

    time: np.ndarray
    observed: np.ndarray
    replicates: np.ndarray
    names: Sequence[str]
    units: Sequence[str]
    labels: Sequence[str] = field(default=())

    def __post_init__(self) -> None:
        outputs, steps = self.observed.shape
        if self.replicates.ndim != 3 or self.replicates.shape[1:] != (outputs, steps):
            raise RecordingError(
                f"replicates: shape is {self.replicates.shape}; expected (B, {outputs}, {steps}), as the residuals have"
            )
        if len(self.replicates) < 19:
            raise RecordingError(f"replicates: found {len(self.replicates)}; expected at least 19 (p below 0.05)")
        if not (len(self.names) == len(self.units) == outputs) or self.time.shape != (steps,):
            raise RecordingError(
                f"residuals: {len(self.names)} names, {len(self.units)} units and {self.time.size} times "
                f"for {outputs} outputs and {steps} steps; expected as many"
            )
        gaps = np.diff(self.time)
        if steps < FEWEST or gaps[0] <= 0 or not np.allclose(gaps, gaps[0], rtol=0, atol=1e-3):
            raise RecordingError("time: not regular or shorter than four steps; expected one positive step throughout")
        if not self.labels:
            object.__setattr__(self, "labels", tuple(self.names))

    @property
    def step(self) -> float:
        """Length of a step [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def middle(self) -> np.ndarray:
        """Middle of each step [s], shape (steps,): decides hour and day."""
        return self.time - self.step / 2

    @property
    def hour(self) -> np.ndarray:
        """Hour of the day [h], shape (steps,)."""
        return self.middle % DAY / HOUR

    @property
    def day(self) -> np.ndarray:
        """Number of the day since time zero, shape (steps,)."""
        return np.floor(self.middle / DAY).astype(int)

    @property
    def weekend(self) -> np.ndarray:
        """Whether a step lies on Saturday or Sunday, shape (steps,)."""
        return self.day % 7 >= 5

    @cached_property
    def stacked(self) -> np.ndarray:
        """Recording first, then the twins, shape (B + 1, outputs, steps).

        What the recording lacks is blanked in the twins too, so that under the null all rows are exchangeable.
        """
        blank = ~np.isfinite(self.observed)
        twins = np.where(blank[None] | ~np.isfinite(self.replicates), np.nan, self.replicates)
        return np.concatenate([np.where(blank, np.nan, self.observed)[None], twins])

    @property
    def measured(self) -> list[int]:
        """Outputs of which the recording has anything."""
        return [k for k in range(len(self.names)) if np.isfinite(self.observed[k]).any()]
