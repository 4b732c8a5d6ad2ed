"""One simulation of a recording, as a runner is asked for it."""

from __future__ import annotations

from dataclasses import dataclass

from datagen.driving.tables import InputTable


@dataclass(frozen=True)
class Run:
    """One simulation: values by name [units of the description], inputs, and what to record (all times [s])."""

    parameters: dict[str, float]
    inputs: InputTable
    start: float
    stop: float
    record_from: float
    replay: bool = False
    tolerance: float | None = None
