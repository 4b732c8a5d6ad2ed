"""What a posterior was fitted to and with: ``posterior.json``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from shared.logs import logger
from shared.store import Records
from trainer.reading.kind import Kind
from trainer.runs.checkpoint import Card
from trainer.runs.systems import Systems

_log = logger(__name__)

SCHEMA_VERSION = 3
"""The first version knows no temperatures of windows that lack an output, and before the third it is not said of what
dataset the posterior is."""

ENOUGH = 9
"""Systems that calibrate: of fewer no share of the truths within their intervals can be told from 90 %, as the least n
with 0.9 (n + 1) <= n is nine."""


class PosteriorCard(BaseModel, extra="forbid"):
    """``posterior.json``."""

    schema_version: int = SCHEMA_VERSION
    estimator_sha256: str
    """of the estimator's weights: the posterior is of no use with others"""
    logarithmic: list[bool]
    """of each parameter: whether its prior is uniform in the logarithm"""
    dataset: Kind | None = None
    """what it was fitted to: intervals allow for what differs between its systems; None in cards of earlier versions"""
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

    def doubt(self) -> str | None:
        """A sentence where the posterior tells nothing, or its intervals hold who knows what share; None elsewhere."""
        systems = len(self.calibration_systems.indices)
        if self.gain <= 0:
            return (
                "the posterior tells less than the ranges of the parameters alone: on the systems that calibrate it"
                f" ({systems}) its density at the truth was {-self.gain:.2f} nat below the prior's"
            )
        if systems < ENOUGH:
            return f"its intervals are calibrated by {systems} systems, too few for 90 %, which takes {ENOUGH}"
        return None

    def seen(self, records: Records) -> np.ndarray:
        """Which rows of records, of the run's own system, the posterior was made with; bool (systems,)."""
        return self.fitting_systems.rows_in(records) | self.calibration_systems.rows_in(records)


def tell_kind(kind: Kind, run: Card, folder: Path) -> None:
    """Warn where intervals will be of systems of another kind than the estimator was trained on.

    ``kind`` is that of the dataset in ``folder``, which a posterior is to be fitted to.
    """
    if run.held is not None and (held := [name for name in kind.held if name not in run.held]):
        _log.warning(
            "%s: has as declared what the estimator has seen drawn, %s: intervals will be too narrow for systems that"
            " have other values",
            *(folder, ", ".join(held)),
        )
    if run.dataset is not None and (unlike := kind.unlike(run.dataset)):
        _log.warning("%s: is unlike the dataset of the estimator's training: %s", folder, "; ".join(unlike))
