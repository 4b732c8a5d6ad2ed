"""What an estimator sees of a window, and how its answer becomes parameters.

A window is the recorded channels in their own units, shape (batch, length, recorded), and the time stamp of its first
sample [s since time zero]. Encoded, it is float32 (batch, length, columns): the recorded channels normalised by the
training systems' mean and standard deviation (paper, section 2.4), then the columns of the derived channels.

Time zero is Monday 1 January 2001, 00:00 local standard time, so that for any date seconds since time zero give both
the time of day and the day of the week by a remainder.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from pydantic import BaseModel, Field, model_validator

from shared.errors import EstimatorError
from shared.schema import Method, methods_of
from shared.store import Records
from shared.system import System
from trainer.reading.facts import with_static

DAY = 86400.0
LONGEST = 10_000_000
"""Samples of a window: a year at steps of three seconds, or a fortnight of every tenth of one."""
DERIVED = {"time_of_day": DAY, "day_of_week": 7 * DAY}
"""Derived channels: sine and cosine of the time stamp with this period [s]."""
LATER = {"methods", "constant", "logarithmic", "given", "known"}
"""Fields of an encoding that earlier cards lack, and that follow from the system's hash and from mean and sd."""

MEASURED = ("mean", "sd", "target_mean", "target_sd", "constant")
"""Fields of an encoding that are measured on training systems."""


def split_channels(system: System, channels: list[str] | None) -> tuple[list[str], list[str]]:
    """Sort channel names into recorded ones, outputs before inputs, and derived ones.

    The system's own names win over the derived. Raises EstimatorError if a channel is unknown or named twice, or no
    recorded channel is among them.
    """
    wanted = list(system.estimator.channels if channels is None else channels)
    known = [*system.output_names, *system.input_names]
    for name in wanted:
        if wanted.count(name) > 1:
            raise EstimatorError(f"channels: {name!r} is named twice")
        if name not in known and name not in DERIVED:
            raise EstimatorError(
                f"channels: {name!r} is not a channel of {system.name}; "
                f"found {', '.join(known)}; derived from the clock: {', '.join(DERIVED)}"
            )
    recorded = [name for name in wanted if name in system.output_names]
    recorded += [name for name in wanted if name in system.input_names]
    if not recorded:
        raise EstimatorError("channels: none of them is recorded; expected at least one output or input of the system")
    return recorded, [name for name in wanted if name not in known]


def units_of(system: System, recorded: list[str]) -> list[str]:
    """Units of recorded channels."""
    units = {one.name: one.unit for one in [*system.outputs, *system.inputs]}
    return [units[name] for name in recorded]


def clock_columns(time: torch.Tensor, length: int, step: float, period: float) -> torch.Tensor:
    """Sine and cosine of the time stamps, float32 (batch, length, 2), from the first ones, float64 (batch,) [s]."""
    stamps = time[:, None] + step * torch.arange(length, dtype=torch.float64, device=time.device)
    angle = (2 * math.pi / period) * torch.remainder(stamps, period)
    return torch.stack([torch.sin(angle), torch.cos(angle)], dim=2).float()


class Fact(BaseModel, extra="forbid", frozen=True, allow_inf_nan=False):
    """A given fact as an estimator reads it: standardised, of its log10 where ``log``."""

    name: str
    unit: str
    log: bool
    mean: float
    sd: float = Field(gt=0)


class Encoding(BaseModel, extra="forbid", frozen=True):
    """Channels, normalisation and targets of one estimator; part of its checkpoint."""

    recorded: list[str]
    outputs: int
    """How many of the recorded channels are outputs; they come first."""
    units: list[str]
    methods: list[Method] = []
    """CF cell methods of the recorded channels; none in earlier cards."""
    derived: list[str]
    step: float = Field(gt=0, allow_inf_nan=False)
    length: int = Field(gt=0, le=LONGEST)
    """Samples of a window; the longest where there are several lengths."""
    shorter: list[int] = []
    """Lengths below it that the estimator was trained on as well."""
    optional: list[str] = []
    """Recorded channels that may be missing, not a number."""
    largest_gap: float = 0.0
    """Share of a window that an output may miss."""
    mean: list[float]
    sd: list[float]
    """One where a channel did not vary in training."""
    constant: list[str] = []
    """Recorded channels that did not vary in training; none in earlier cards."""
    parameters: list[str]
    parameter_units: list[str]
    parameter_min: list[float]
    parameter_max: list[float]
    logarithmic: list[bool] = []
    """Of each parameter, whether its prior is uniform in the logarithm; none in earlier cards."""
    target_mean: list[float]
    target_sd: list[float]
    known: bool = False
    """Whether windows may tell parameters that are known; not in earlier cards."""
    given: list[Fact] = []
    """Given facts that windows may tell; none in earlier cards."""

    @model_validator(mode="after")
    def _fits(self) -> Encoding:
        """What a file says of channels and parameters goes together, and can be computed with."""
        for count, names in (
            (len(self.recorded), ("units", "mean", "sd")),
            (len(self.parameters), ("parameter_units", "parameter_min", "parameter_max", "target_mean", "target_sd")),
        ):
            for name in names:
                if len(getattr(self, name)) != count:
                    raise ValueError(f"{name}: has {len(getattr(self, name))} values; expected {count}")
        for name, count in (("methods", len(self.recorded)), ("logarithmic", len(self.parameters))):
            if len(getattr(self, name)) not in (0, count):
                raise ValueError(f"{name}: has {len(getattr(self, name))} values; expected {count}, or none")
        for name in self.constant:
            if name not in self.recorded:
                raise ValueError(f"constant: {name!r} is not known; expected one of {', '.join(self.recorded)}")
        for name in ("mean", "sd", "parameter_min", "parameter_max", "target_mean", "target_sd"):
            if not all(math.isfinite(value) for value in getattr(self, name)):
                raise ValueError(f"{name}: has a value that is not finite")
        if min([*self.sd, *self.target_sd], default=1.0) <= 0:
            raise ValueError("sd, target_sd: has a value that is not positive")
        if not 0 <= self.outputs <= len(self.recorded):
            raise ValueError(f"outputs: is {self.outputs}; expected 0 to {len(self.recorded)}")
        for name in self.derived:
            if name not in DERIVED:
                raise ValueError(f"derived: {name!r} is not known; expected one of {', '.join(DERIVED)}")
        return self

    @property
    def channels(self) -> list[str]:
        """Names of all channels."""
        return [*self.recorded, *self.derived]

    @property
    def lengths(self) -> list[int]:
        """Samples of the windows that can be read, rising."""
        return [*self.shorter, self.length]

    @property
    def columns(self) -> int:
        """Columns of an encoded window."""
        return len(self.recorded) + 2 * len(self.derived) + 2 * len(self.facts)

    @property
    def facts(self) -> list[str]:
        """Names of the facts that windows may tell: parameters, then given facts."""
        return [*(self.parameters if self.known else []), *(one.name for one in self.given)]

    def standardised(self, facts: np.ndarray) -> torch.Tensor:
        """Facts (windows, facts) [own units], not a number where unknown, standardised; float32."""
        count = len(self.facts) - len(self.given)
        parts = [self.targets(facts[:, :count])] if count else []
        for k, one in enumerate(self.given):
            values = np.asarray(facts[:, count + k], dtype=np.float64)
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.log10(values) if one.log else values
            parts.append(torch.from_numpy(((values - one.mean) / one.sd).astype(np.float32))[:, None])
        return torch.cat(parts, dim=1) if parts else torch.zeros((len(facts), 0))

    def absent_from(self, values: np.ndarray) -> list[str]:
        """Optional channels that are missing throughout windows (windows, length, recorded)."""
        lost = np.isnan(values).all(axis=(0, 1))
        return [name for name, gone in zip(self.recorded, lost, strict=True) if gone and name in self.optional]

    def scales(self) -> list[bool]:
        """Of each parameter, whether its prior is uniform in the logarithm; none is where a card does not say it."""
        return self.logarithmic or [False] * len(self.parameters)

    def encode(self, values: torch.Tensor, time: torch.Tensor, static: torch.Tensor | None = None) -> torch.Tensor:
        """Windows (batch, length, recorded) [units] and first stamps (batch,) [s] to (batch, length, columns).

        ``static`` are the columns of facts (batch, 2 facts); without, all of them are unknown.
        """
        device = values.device
        parts = [(values - torch.tensor(self.mean, device=device)) / torch.tensor(self.sd, device=device)]
        parts += [clock_columns(time, values.shape[1], self.step, DERIVED[name]) for name in self.derived]
        windows = torch.cat(parts, dim=2)
        if not self.facts:
            return windows
        unknown = torch.zeros((len(values), 2 * len(self.facts)), device=device)
        return with_static(windows, unknown if static is None else static)

    def targets(self, parameters: np.ndarray) -> torch.Tensor:
        """Parameters (windows, parameters) [own units] to standardised :func:`scaled` ones, float32."""
        targets = (scaled(parameters, self.parameter_min) - np.array(self.target_mean)) / np.array(self.target_sd)
        return torch.from_numpy(targets.astype(np.float32))

    def estimates(self, answers: torch.Tensor, factors: np.ndarray | None = None) -> np.ndarray:
        """An estimator's answers (windows, parameters) to parameters [own units], float64.

        They are clipped to the ranges of the system description: the prior gives what lies outside no chance.
        ``factors`` (parameters,) make means of them (:mod:`trainer.runs.scatter`); None leaves them as they are.
        """
        targets = answers.double().cpu().numpy() * np.array(self.target_sd) + np.array(self.target_mean)
        positive = np.array(self.parameter_min) > 0
        found = np.where(positive, 10.0 ** np.where(positive, targets, 0.0), targets)
        return np.clip(found if factors is None else factors * found, self.parameter_min, self.parameter_max)

    def log_ratio(self, found: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """ln(found / truth) of parameters (windows, parameters); 0 where targets are no logarithms."""
        positive = np.array(self.parameter_min) > 0
        return np.asarray(np.log(np.where(positive, found, 1.0) / np.where(positive, truth, 1.0)))


def scaled(parameters: np.ndarray, lowest: Sequence[float]) -> np.ndarray:
    """Parameters (..., parameters) as targets have them: log10 of those whose range has a ``lowest`` value above 0."""
    positive = np.array(lowest) > 0
    return np.where(positive, np.log10(np.where(positive, parameters, 1.0)), parameters)


def make_encoding(
    system: System,
    records: Records,
    derived: list[str],
    length: int,
    training: np.ndarray,
    *,
    shorter: list[int] | None = None,
    optional: list[str] | None = None,
    largest_gap: float = 0.0,
    facts: bool = False,
) -> Encoding:
    """Encoding of a dataset, from the rows ``training`` of its records alone.

    A channel or target that does not vary keeps its mean and gets a standard deviation of one. Such channels are noted:
    what an estimator has never seen move it cannot read.
    """
    step = float(records.time[1] - records.time[0]) if len(records.time) > 1 else system.experiment.step
    means, variances = [], []
    for row in training:  # system by system: a float64 copy of all records would double the memory
        series = records.values[row].astype(np.float64)
        means.append(series.mean(axis=1))
        variances.append(series.var(axis=1))
    mean = np.mean(means, axis=0)
    sd = np.sqrt(np.mean(variances, axis=0) + np.var(means, axis=0))
    varies = sd > 1e-6 * np.abs(mean)
    targets = scaled(records.parameters[training], [p.min for p in system.parameters])
    target_mean, target_sd = targets.mean(axis=0), targets.std(axis=0)
    methods = methods_of(system)
    return Encoding(
        recorded=records.channels,
        outputs=sum(name in system.output_names for name in records.channels),
        units=units_of(system, records.channels),
        methods=[methods[name] for name in records.channels],
        derived=derived,
        step=step,
        length=length,
        shorter=shorter or [],
        optional=optional or [],
        largest_gap=largest_gap,
        mean=mean.tolist(),
        sd=np.where(varies, sd, 1.0).tolist(),
        constant=[name for name, moves in zip(records.channels, varies, strict=True) if not moves],
        parameters=system.parameter_names,
        parameter_units=[p.unit for p in system.parameters],
        parameter_min=[p.min for p in system.parameters],
        parameter_max=[p.max for p in system.parameters],
        logarithmic=[p.scale == "log" for p in system.parameters],
        target_mean=target_mean.tolist(),
        target_sd=np.where(target_sd > 1e-9, target_sd, 1.0).tolist(),
        known=facts,
        given=_given(system, records.given[training]) if facts else [],
    )


def _given(system: System, values: np.ndarray) -> list[Fact]:
    """The description's given facts, with means and spreads of training systems (systems, facts)."""
    made = []
    for k, one in enumerate(system.told):
        log = one.scale == "log"
        numbers = np.log10(values[:, k]) if log else values[:, k]
        sd = float(numbers.std())
        made.append(
            Fact(name=one.name, unit=one.unit, log=log, mean=float(numbers.mean()), sd=sd if sd > 1e-9 else 1.0)
        )
    return made
