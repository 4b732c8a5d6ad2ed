"""Ceilings: the linearised Bayesian limit of R2; ``datagen identifiability`` writes it, ``trainer evaluate`` reads it.

A ceiling belongs to a system, a context length, a noise preset, a set of channels, a season and what is known of the
constants: weeks in January and in July do not tell the same, and neither do a floor as declared and one of nobody
knows what weight. The file lies beside the system description and is copied into every dataset made from it that has
the season, the weather and the constants of one of its ceilings; with ceilings that the dataset has already it is
joined, and of one condition those of more systems stay.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import xarray as xr
from pydantic import BaseModel, Field

from shared.errors import ZeroshotError
from shared.manifest import write_atomically
from shared.reading import newer, read_json, validated
from shared.results import Result
from shared.system import Experiment
from shared.variables import Uncertain

FILE_NAME = "identifiability.json"
SCHEMA_VERSION = 2
"""Of files that are written. Those of version 1 are read: they have an interval for a single system, too."""
YEAR = 8760.0
"""Hours."""
WHOLE = YEAR - 168.0
"""From so many hours on, records cover the whole year: a year of 52 weeks is one, too."""


class Origin(BaseModel, extra="forbid", allow_inf_nan=False):
    """Records that windows are drawn from: they begin between two hours of the year, and each has ``hours``.

    ``weather`` is the sha256 of each weather file: the system's hash knows their names alone. ``warm_up_hours`` is how
    long they are simulated before they begin: a transient from the model's start tells what a settled room does not.
    Of files that do not say it, it was 240 h, whatever the description said.
    """

    start: tuple[float, float]
    hours: float = Field(gt=0)
    weather: dict[str, str] = {}
    warm_up_hours: float = Field(240.0, ge=0)

    @classmethod
    def of(cls, experiment: Experiment, weather: Mapping[str, str] | None = None) -> Origin:
        """That of records as a description has them."""
        start, hours, warm_up = experiment.start, experiment.hours, experiment.warm_up_hours
        return cls(start=start, hours=hours, weather=dict(weather or {}), warm_up_hours=warm_up)

    def kind(self) -> tuple[tuple[float, float] | None, float]:
        """Season and warm-up: limits of one condition and of one kind are of the same."""
        return self.season(), self.warm_up_hours

    def season(self) -> tuple[float, float] | None:
        """First and last hour of the year that any window covers; beyond a turn of the year it counts on.

        None is the whole year: one record of a year and many short ones that begin anywhere in it are of one season.
        """
        first, last = self.start
        span = last - first + self.hours
        return None if span >= WHOLE else (first % YEAR, first % YEAR + span)

    def unlike(self, other: Origin) -> str:
        """Why limits on windows of this origin are none for a dataset of ``other``; empty where they are."""
        if self.season() != other.season():
            return f"it is of {_named(self.season())}; this dataset is of {_named(other.season())}"
        if self.warm_up_hours != other.warm_up_hours:
            ours, theirs = (f"{one.warm_up_hours:g} h" for one in (self, other))
            return f"it is of records that are warmed up for {ours}; this dataset's are for {theirs}"
        for file in sorted(self.weather.keys() & other.weather.keys()):
            ours, theirs = self.weather[file], other.weather[file]
            if ours != theirs:
                return f"it is of weather {file} with sha256 {ours[:12]}; this dataset's has {theirs[:12]}"
        return ""


def _named(season: tuple[float, float] | None) -> str:
    return "the whole year" if season is None else f"hours {season[0]:g} to {season[1]:g} of the year"


_OLD = Origin(start=(0.0, 0.0), hours=YEAR)
"""Of ceilings that do not say it: nearly all were made over a year."""


class Unknown(BaseModel, extra="forbid", allow_inf_nan=False):
    """A constant that was drawn, and that nobody knows: FMU parameters, all times exp(``relative`` * N(0, 1))."""

    parameters: list[str]
    relative: float = Field(gt=0)


def unknown_constants(drawn: Iterable[Uncertain]) -> dict[str, Unknown]:
    """By name, uncertain constants that are drawn for each system; those that are not are as declared, and known."""
    return {one.name: Unknown(parameters=sorted(one.parameters), relative=one.relative) for one in drawn}


def in_words(constants: Mapping[str, Unknown]) -> str:
    """What is known of constants, in words."""
    drawn = ", ".join(f"{name} {one.relative:g}" for name, one in constants.items())
    return f"constants drawn ({drawn})" if drawn else "constants as declared"


class Ceiling(Result, BaseModel, extra="forbid"):
    """Limit of R2 per parameter under one condition, averaged over ``systems`` random systems and windows.

    ``origin`` says what the windows were of; older files lack it, and are taken to be of the whole year. ``constants``
    are those that the limit took as unknown; all others are as declared. ``r2_mean_low`` and ``r2_mean_high`` are the
    90 % interval of the mean over systems; of one system there is none.
    """

    context_hours: float
    step: float
    noise: str
    channels: list[str]
    r2: dict[str, float]
    r2_mean: float
    r2_mean_low: float | None
    r2_mean_high: float | None
    systems: int
    seed: int
    origin: Origin | None = None
    constants: dict[str, Unknown] = {}

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        return (
            f"{self.context_hours:g} h, noise {self.noise}, {self.systems} systems: mean R2 at most {self.r2_mean:.3f}"
        )

    def to_dataframe(self) -> Any:
        """A row for each parameter: the limit of its R2."""
        return xr.Dataset({"r2": ("parameter", list(self.r2.values()))}, {"parameter": list(self.r2)}).to_dataframe()

    def known_origin(self) -> Origin:
        """What the windows were of, also of an older file."""
        return self.origin or _OLD


class Ceilings(BaseModel, extra="forbid"):
    """All ceilings known of one system."""

    schema_version: int = SCHEMA_VERSION
    system_name: str
    system_hash: str
    fmu_sha256: str
    outputs: list[str]
    nuisances: list[str] = []
    ceilings: list[Ceiling] = []

    def find(
        self, *, context_hours: float, step: float, noise: str, channels: list[str], constants: Mapping[str, Unknown]
    ) -> list[Ceiling]:
        """The ceilings of a condition, one for each season that it was computed for.

        Of the channels, outputs count, and whether any is among the ``nuisances``: one that is measured is known. Other
        inputs are taken as known anyway. Ceilings without an origin were computed as though no nuisance could be
        measured: where they name one they are too low, and not found.
        """
        wanted = (context_hours, step, noise, constants, *self._told(channels))
        return [one for one in self.ceilings if self._condition(one) == wanted and not self._too_low(one)]

    def put(self, ceiling: Ceiling) -> None:
        """Add a ceiling in place of those for the same condition and season."""
        self.ceilings = [one for one in self.ceilings if self._key(one) != self._key(ceiling)] + [ceiling]

    def put_unless_fewer(self, ceiling: Ceiling) -> None:
        """The same, unless there is one of more systems already."""
        if all(one.systems <= ceiling.systems for one in self.ceilings if self._key(one) == self._key(ceiling)):
            self.put(ceiling)

    def _key(self, one: Ceiling) -> tuple[object, ...]:
        return (*self._condition(one), one.known_origin().kind())

    def _told(self, channels: list[str]) -> tuple[list[str], bool]:
        """The outputs among channels, and whether they tell the nuisance: all of these are one and the same signal."""
        return sorted(set(channels) & set(self.outputs)), bool(set(channels) & set(self.nuisances))

    def _condition(self, one: Ceiling) -> tuple[object, ...]:
        return (one.context_hours, one.step, one.noise, one.constants, *self._told(one.channels))

    def _too_low(self, one: Ceiling) -> bool:
        return one.origin is None and self._told(one.channels)[1]


def fitting(ceilings: list[Ceiling], dataset: Origin, constants: Mapping[str, Unknown]) -> tuple[Ceiling | None, str]:
    """The first of some ceilings that holds for a dataset with such constants; where there is none, None and why."""
    same = [one for one in ceilings if one.constants == constants]
    if ceilings and not same:
        return None, f"it has none with {in_words(constants)}"
    # of the dataset's own season first: why that one does not hold says most
    ordered = sorted(same, key=lambda one: one.known_origin().season() != dataset.season())
    reasons = [one.known_origin().unlike(dataset) for one in ordered]
    if "" in reasons:
        return ordered[reasons.index("")], ""
    return None, reasons[0] if reasons else "it has none"


def read_ceilings(path: Path) -> Ceilings:
    """Read a ceilings file, of this version or an older one, as one of this version.

    Raises
    ------
    ZeroshotError
        If it is missing, not such a file, or of a newer version.
    """
    expected = "a file of `datagen identifiability`"
    raw = read_json(path, ZeroshotError, expected)
    version = raw.get("schema_version", 1) if isinstance(raw, dict) else 1
    if said := newer(version, SCHEMA_VERSION):
        raise ZeroshotError(f"{path}: {said}")
    found = validated(Ceilings, raw, f"{path}", ZeroshotError, expected)
    return found.model_copy(update={"schema_version": SCHEMA_VERSION})


def write_ceilings(path: Path, ceilings: Ceilings) -> None:
    """Write a ceilings file whole."""
    write_atomically(path, (ceilings.model_dump_json(indent=1) + "\n").encode())
