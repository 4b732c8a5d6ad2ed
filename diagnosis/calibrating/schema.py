"""``calibration.json``: what a calibration found."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from diagnosis.physics import Finding
from diagnosis.scores import Score
from shared.errors import RecordingError
from shared.reading import newer, read_json, shown, validated

SCHEMA_VERSION = 8


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Parameter(_Table):
    """One parameter.

    ``low`` and ``high`` are the ends of the 90 % credible interval [unit]; ``told`` is the share of
    the prior variance that the recording removed, in the scale in which the prior is standard normal.
    """

    name: str
    description: str
    unit: str
    prior_min: float
    prior_max: float
    value: float
    low: float
    high: float
    told: float
    identified: str
    at_bound: bool
    zero_shot: float | None = None


class Constant(_Table):
    """An uncertain constant: by what its FMU parameters are multiplied, with the 90 % credible interval."""

    name: str
    description: str
    factor: float
    low: float
    high: float


class Channel(Score):
    """One output.

    Scores of the fit, the standard deviation of a reading's noise that was ``declared`` (of an undeclared one, that as
    which it was taken) and the noise that was found [unit; h]. ``chi2`` is the mean square of the
    standardised residual with the nuisance integrated out: near 1 where model and noise explain the recording.
    ``explained``: share of the variance that the model explains with the most likely nuisance, both without that of
    the sensor's declared noise; None for an output that hardly moved beyond it, or was replayed.
    """

    used: bool
    declared: float
    noise: float
    slow_noise: float
    slow_hours: float
    chi2: float | None
    explained: float | None = None


class Pair(_Table):
    """Two parameters that the recording cannot well tell apart."""

    first: str
    second: str
    correlation: float


class Day(_Table):
    """A day that was fitted: begin of its first step by the recording's clock, its steps.

    ``sha256`` is that of the readings of each output that moved, of none where they do not tell the day from others:
    see :mod:`diagnosis.calibrating.seen`.
    """

    begin: str
    steps: int
    sha256: dict[str, str]


class Calibration(_Table):
    """``calibration.json``.

    ``covariance`` (unknowns, unknowns) is that of the posterior in which the recording counts for 1 / ``widened``^2 of
    what it is worth to the model: see :mod:`diagnosis.fitting.spread`. ``undeclared``: of outputs whose sensor has no
    declared noise, as how exact they were taken. ``physics``: what in the recording cannot be, or contradicts the
    description. What each schema added is in CHANGELOG.md.
    """

    schema_version: int = SCHEMA_VERSION
    system: str
    system_hash: str
    fmu_sha256: str
    recording: str
    steps: int
    step: float
    start: float
    days: Annotated[list[Day], Field(min_length=1)]
    replay: bool
    occupancy: str
    assumed: dict[str, str]
    replayed: list[str]
    started_from: str
    parameters: list[Parameter]
    constants: list[Constant] = []
    correlated: list[Pair]
    correlation: list[list[float]]
    outputs: dict[str, Channel]
    undeclared: dict[str, str] = {}
    z: list[float]
    covariance: list[list[float]]
    widened: float
    physics: list[Finding] = []
    wider: str = Field("", description="the description with wider ranges, if the system names one")
    log_likelihood: float
    log_evidence: float
    converged: bool
    stopped: bool = Field(False, description="whether the time was up before the fit came to rest")
    simulations: int
    seconds: float

    def parameter(self, name: str) -> Parameter:
        """A parameter by its name."""
        return next(one for one in self.parameters if one.name == name)


def read_calibration(path: Path | str) -> Calibration:
    """Read ``calibration.json``, or the one in a folder.

    Raises
    ------
    RecordingError
        If it is missing, not such a file, or of an earlier version.
    """
    path = Path(path)
    path = path / "calibration.json" if path.is_dir() else path
    expected = "a file of `diagnosis calibrate`"
    raw = read_json(path, RecordingError, expected)
    version = raw.get("schema_version") if isinstance(raw, dict) else None
    if isinstance(version, int) and version < SCHEMA_VERSION:
        lacks = "does not say, output by output, all days that the calibration has seen"
        lacks = lacks if version < 7 else "has shares of a temperature's range as CVRMSE and NMBE"
        raise RecordingError(
            f"{path}: schema_version is {shown(version)}, which {lacks}; expected {SCHEMA_VERSION}, {expected} of this"
            " version: calibrate again"
        )
    if said := newer(SCHEMA_VERSION if version is None else version, SCHEMA_VERSION):
        raise RecordingError(f"{path}: {said}")
    return validated(Calibration, raw, f"{path}", RecordingError, expected)
