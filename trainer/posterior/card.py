"""What a posterior was fitted to and with: ``posterior.json``."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from shared.store import Records
from trainer.runs.checkpoint import Systems

SCHEMA_VERSION = 2


class PosteriorCard(BaseModel):
    """``posterior.json``."""

    model_config = ConfigDict(extra="forbid")
    schema_version: int = SCHEMA_VERSION
    estimator_sha256: str
    """of the estimator's weights: the posterior is of no use with others"""
    logarithmic: list[bool]
    """of each parameter: whether its prior is uniform in the logarithm"""
    context: int
    lengths: list[int]
    """window lengths [samples], rising; each has temperatures of its own"""
    options: dict[str, Any]
    fitting_systems: Systems
    calibration_systems: Systems
    fitting_windows: int
    calibration_windows: int
    training_systems_used: int
    """how many of the fitting systems the estimator had trained on"""
    temperatures: list[dict[str, float]]
    """of each length: the factor that calibration stretches each parameter's density by, where no output is missing"""
    temperatures_lacking: list[dict[str, float]] = []
    """the same where an output is missing as a whole; equal in posteriors of the first version, which do not have it"""
    gain: float
    """mean log posterior density above the prior's on the calibration systems, before the temperatures [nat]"""
    epochs: int
    best_epoch: int
    seed: int
    seconds: float
    versions: dict[str, str]
    weights_sha256: str = ""

    def seen(self, records: Records) -> np.ndarray:
        """Which rows of records, of the run's own system, the posterior was made with; bool (systems,)."""
        return self.fitting_systems.rows_in(records) | self.calibration_systems.rows_in(records)
