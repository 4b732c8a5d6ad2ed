"""One place where recording and model differ, as a sentence and as a row of the report."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from diagnosis.where.bands import MEANING, WHOLE
from shared.numbers import number
from shared.variables import spaced

Kind = Literal["cell", "correlation", "episode", "source", "sensor"]


@dataclass(frozen=True)
class Finding:
    """A significant difference.

    ``cell`` says where it lies, in words by name; ``size`` is the difference in ``unit``: measured less simulated, to
    the rest of the recording where ``direction`` says "than elsewhere" or "than in the rest of the recording", and for
    scatter that of the standard deviations. Means are of all periods, in whatever band they stand out. ``t`` is its
    studentised value and ``p_value`` the family-wise one.
    """

    kind: Kind
    channel: str
    label: str
    cell: dict[str, str]
    p_value: float
    direction: str
    size: float
    unit: str
    t: float

    @property
    def text(self) -> str:
        """As a sentence."""
        return f"{self.label}: {self.direction}{self._amount()}{self._place()} (p = {self.p_value:.2g})"

    def _amount(self) -> str:
        if self.kind == "correlation":
            return f" (r = {self.size:+.2f})"
        if self.kind == "sensor":
            return f" (log likelihood ratio {number(self.size, 3, signed=True)})"
        return f" by {number(abs(self.size), 3)}{spaced(self.unit)}"

    def _place(self) -> str:
        words = []
        if self.kind == "sensor":
            return ""
        if self.kind in ("episode", "source"):
            return f", {self.cell['period']}"
        if self.kind == "correlation":
            return f" {self.cell['input']}, {self.cell['lag']}"
        if self.cell["hours"] != "any":
            words.append(f"at {self.cell['hours']}")
        if self.cell["day_type"] != "any":
            words.append(f"on {self.cell['day_type']}s" if self.cell["day_type"] == "weekday" else "at weekends")
        if self.cell["regime"] != "any":
            words.append(f"while {self.cell['regime']}")
        if self.cell["band"] != WHOLE and self.cell["statistic"] != "mean":  # the amount of a mean is no band's
            words.append(f"over {MEANING[self.cell['band']]}")
        return ", " + ", ".join(words) if words else ", throughout"
