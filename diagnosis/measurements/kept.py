"""What of a recording can be used: its stretches without gaps in inputs, and what would make them longer."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.measurements.grid import Series
from diagnosis.measurements.signal import Signal
from diagnosis.measurements.spacing import usual_gap
from diagnosis.recording import needed_inputs
from shared.flags import IMPOSSIBLE, STUCK
from shared.numbers import counted
from shared.stretches import runs, stretches
from shared.system import System
from shared.variables import OccupancyInput

MUCH = 0.05
"""Share of the hours in which outputs were measured: who loses more is told what would keep them."""


@dataclass(frozen=True, eq=False)
class Kept:
    """The steps of a recording that a simulation can use.

    ``series`` are of the recording's span, which begins at ``begin`` [s of the clock]; ``step`` is its step [s], and
    ``valid`` has the lines of the mapping that keep what was left out as impossible, by where they belong.
    """

    series: Sequence[Series]
    system: System
    step: float
    begin: float
    valid: Mapping[str, str]

    @property
    def measured(self) -> np.ndarray:
        """Steps in which any output was measured, (steps,)."""
        outputs = [np.isfinite(one.values) for one in self.series if one.target.role == "output"]
        return np.asarray(np.any(outputs, axis=0))

    @property
    def needed(self) -> list[Series]:
        """The inputs that a simulation reads unless told otherwise."""
        inputs = {one.target.name: one for one in self.series if one.target.role == "input"}
        return [inputs[name] for name in needed_inputs(self.system, inputs)]

    @property
    def crowd(self) -> frozenset[str]:
        """Inputs that are persons: a simulation does without a count of them."""
        return frozenset(one.name for one in self.system.inputs if isinstance(one, OccupancyInput))

    def stretches(self, without: frozenset[str] = frozenset()) -> list[tuple[int, int]]:
        """Stretches of at least a day, ``without`` regard to some inputs; all of a recording without gaps."""
        whole = np.ones(len(self.measured), dtype=bool)
        for one in self.needed:
            whole &= np.isfinite(one.values) | (one.target.name in without)
        return stretches(whole, self.step)

    def hours(self, found: Sequence[tuple[int, int]] | None = None) -> float:
        """Hours in which outputs were measured, of some stretches or of all the recording [h]."""
        measured = self.measured
        count = sum(int(measured[a:b].sum()) for a, b in found) if found is not None else int(measured.sum())
        return count * self.step / 3600.0

    def gaps(self) -> str:
        """Which needed inputs have no value in how many steps; empty if all have."""
        gaps = {one.target.name: int((~np.isfinite(one.values)).sum()) for one in self.needed}
        return ", ".join(f"{name} in {count} steps" for name, count in gaps.items() if count)

    def sentences(self) -> list[str]:
        """What is said of a recording with gaps in its inputs."""
        if not (gaps := self.gaps()):
            return []
        found = self.stretches()
        kept = self.hours(found)
        said = [
            f"inputs have no values ({gaps}): {counted(len(found), 'stretch', 'stretches')} of a day or more without"
            f" gaps hold{'s' * (len(found) == 1)} {kept:g} of {self.hours():g} h in which outputs were measured"
        ]
        if len(found) > 1:
            said.append("a command takes the longest stretch, or another by --stretch, or --from and --to")
        more = self.hours(self.stretches(without=self.crowd))
        if more > kept + MUCH * self.hours():
            said.append(
                f"with --occupancy unknown, {more:g} h: the gaps in {', '.join(sorted(self.crowd))} do not count then"
            )
        return said + self.remedies(MUCH)

    def remedies(self, share: float) -> list[str]:
        """For each reason why inputs lack more than a share of the hours measured, what to write in the mapping."""
        measured = self.measured
        reasons: dict[tuple[str, str, int], list[Series]] = {}
        for one in self.needed:
            lost = measured & ~np.isfinite(one.values)
            if one.key and lost.sum() > share * measured.sum():
                reasons.setdefault((*self._reason(one, lost), int(lost.sum())), []).append(one)
        said = []
        for (why, line, count), lacking in reasons.items():
            names = ", ".join(f"{one.target.name} ({one.origin})" for one in lacking)
            keys = ", ".join(header(key) for key in dict.fromkeys(one.key for one in lacking))
            said.append(
                f"{names}: no value in {count * self.step / 3600:g} of {self.hours():g} h in which outputs were"
                f" measured, {why}; {line} under {keys} would keep them"
            )
        return said

    def _reason(self, one: Series, lost: np.ndarray) -> tuple[str, str]:
        """Why an input has no value in the steps ``lost`` (steps,), and the line of the mapping that gives it one."""
        flags = one.flags[lost]
        if np.mean((flags & STUCK) > 0) > 0.5:
            return "as its readings stand still", "stuck_after = 0.0"
        if np.mean((flags & IMPOSSIBLE) > 0) > 0.5:
            return "as its readings are impossible", self.valid.get(one.key, "valid = [lowest, highest]")
        if one.signal is not None and (line := line_of_spacing(one.signal, self.begin + self.step * np.argmax(lost))):
            return "where its readings are further apart than usual", line
        gaps = [(a, b) for a, b in runs(~np.isfinite(one.values)) if lost[a:b].any()]
        longest = max(b - a for a, b in gaps) * self.step / 3600.0
        if one.signal is not None and one.signal.kind == "hold":
            return f"in gaps of up to {longest:g} h", f"max_gap = {longest + self.step / 3600.0:g}"
        return f"in gaps of up to {longest:g} h", f'fill = "interpolate" with fill_up_to = {longest:.4g}'


def header(key: str) -> str:
    """The header of a table of the mapping, as TOML has it: names with dots are quoted."""
    table, _, name = key.partition(".")
    return f"[{key}]" if re.fullmatch(r"[\w-]+", name, re.ASCII) else f'[{table}."{name}"]'


def about_spacing(signal: Signal, end: float) -> str:
    """How far apart readings are after ``end`` [s], where that is so much further than usual that it leaves gaps."""
    line = line_of_spacing(signal, end)
    if not line:
        return ""
    middle = signal.middle
    usual, apart = float(np.median(np.diff(middle))), float(np.median(np.diff(middle[middle > end])))
    return (
        f": its readings are {apart:g} s apart from there on, and usually {usual:g} s; expected the same spacing"
        f" throughout, or {line}"
    )


def line_of_spacing(signal: Signal, end: float) -> str:
    """The line of a mapping that takes readings after ``end`` [s] for as far apart as they are; empty if none does."""
    middle, length = signal.middle, signal.end - signal.begin
    after = middle > end
    if after.sum() < 2:
        return ""
    usual, apart = float(np.median(np.diff(middle))), float(np.median(np.diff(middle[after])))
    if apart <= usual_gap(usual) or np.median(length[after]) >= apart:
        return ""
    return f"interval = {apart:g}" if signal.kind == "mean" else f"max_gap = {apart / 3600:.3g}"
