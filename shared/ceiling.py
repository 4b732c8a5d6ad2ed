"""Ceilings: the linearised Bayesian limit of R2; ``datagen identifiability`` writes it, ``trainer evaluate`` reads it.

A ceiling belongs to a system, a context length, a noise preset and a set of channels. The file lies beside the system
description and is copied into every dataset made from it.
"""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from shared.errors import ZeroshotError
from shared.reading import read_json, validated
from shared.store import write_atomically

FILE_NAME = "identifiability.json"


class Ceiling(BaseModel):
    """Limit of R2 per parameter under one condition, averaged over ``systems`` random systems and windows."""

    model_config = ConfigDict(extra="forbid")
    context_hours: float
    step: float
    noise: str
    channels: list[str]
    r2: dict[str, float]
    r2_mean: float
    r2_mean_low: float
    r2_mean_high: float
    systems: int
    seed: int


class Ceilings(BaseModel):
    """All ceilings known of one system."""

    model_config = ConfigDict(extra="forbid")
    schema_version: int = 1
    system_name: str
    system_hash: str
    fmu_sha256: str
    outputs: list[str]
    nuisances: list[str] = []
    ceilings: list[Ceiling] = []

    def find(self, *, context_hours: float, step: float, noise: str, channels: list[str]) -> Ceiling | None:
        """The ceiling of a condition, or None where it was not computed.

        Only outputs among the channels count: inputs other than the ``nuisances`` are taken as known anyway. A nuisance
        that is measured is no nuisance, and has no ceiling here.
        """
        if set(channels) & set(self.nuisances):
            return None
        measured = sorted(set(channels) & set(self.outputs))
        for one in self.ceilings:
            same = (one.context_hours, one.step, one.noise) == (context_hours, step, noise)
            if same and sorted(set(one.channels) & set(self.outputs)) == measured:
                return one
        return None

    def put(self, ceiling: Ceiling) -> None:
        """Add a ceiling in place of the one for the same condition."""
        old = self.find(
            context_hours=ceiling.context_hours, step=ceiling.step, noise=ceiling.noise, channels=ceiling.channels
        )
        self.ceilings = [one for one in self.ceilings if one is not old] + [ceiling]


def read_ceilings(path: Path) -> Ceilings:
    """Read a ceilings file.

    Raises
    ------
    ZeroshotError
        If it is missing or not such a file.
    """
    expected = "a file of `datagen identifiability`"
    return validated(Ceilings, read_json(path, ZeroshotError, expected), f"{path}", ZeroshotError, expected)


def write_ceilings(path: Path, ceilings: Ceilings) -> None:
    """Write a ceilings file whole."""
    write_atomically(path, (ceilings.model_dump_json(indent=1) + "\n").encode())
