"""What is fitted: an estimator under a condition, once for each seed."""

from __future__ import annotations

import hashlib
import re
from typing import Any

from pydantic import BaseModel

from trainer.models import estimator_class


class Condition(BaseModel, extra="forbid", frozen=True):
    """An estimator and what it is given."""

    model: str
    context_hours: float
    channels: tuple[str, ...]
    noise: str = "none"
    systems: int | None = None
    """the first so many training systems; None is all"""
    patch: int | None = None
    """samples of a patch; None is the estimator's own"""


class Budget(BaseModel, extra="forbid", frozen=True):
    """What each fit may take: wall-clock minutes or optimiser steps. Windows a step are each model's own."""

    minutes: float | None = None
    steps: int | None = None

    def of(self, model: str) -> dict[str, Any]:
        """Arguments of a fit. An estimator that is solved rather than iterated takes what it takes."""
        return self.model_dump() if estimator_class(model).iterates else {}

    def text(self) -> str:
        """In words."""
        return f"{self.minutes:g} min" if self.minutes is not None else f"{self.steps} steps"


class Fit(BaseModel, extra="forbid", frozen=True):
    """One fit; equal fits have equal keys."""

    condition: Condition
    seed: int
    budget: Budget
    windows: int
    """drawn for each protocol when it is scored"""

    def key(self) -> str:
        """The name of its folder: what a person wants to see, then a hash of everything."""
        one = self.condition
        digest = hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:10]
        return re.sub(r"[^\w.-]", "_", f"{one.model}-{one.context_hours:g}h-{one.noise}-seed{self.seed}-{digest}")

    def title(self) -> str:
        """For progress lines."""
        one = self.condition
        parts = [one.model, f"{one.context_hours:g} h", f"{len(one.channels)} channels", f"noise {one.noise}"]
        parts += [f"{one.systems} systems"] if one.systems else []
        parts += [f"patch {one.patch}"] if one.patch else []
        return ", ".join([*parts, f"seed {self.seed}"])
