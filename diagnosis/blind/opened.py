"""Answers and verdicts side by side, one row for each recording: what all figures of a score are made from.

When an effect can be expected to be seen is said here, from the sealed series alone; see :func:`visible`.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from diagnosis.blind.verdicts import Outcome, Place, Run, check_program, read_outcome, read_withheld
from diagnosis.where.series import split
from shared.errors import RecordingError
from shared.reading import why

HOUR, DAY = 3600.0, 86400.0
SAME = 0.5
"""A channel is right when its sealed gap over noise is at least this share of the largest channel's."""
SHIFTS = 100
_RULE = re.compile(r" (?P<sign>[<>=]) (?P<value>\S+)( .*)?")
"""After a name, which may have spaces itself."""
_SIGNS = {"<": operator.lt, ">": operator.gt, "=": operator.eq}


@dataclass(frozen=True)
class Hit:
    """Of one recording whose gap can be seen.

    ``channel``: whether the first place's channel is right; ``any_channel``: whether any place's is. ``lift``: mean
    square of the sealed gap within the first cell over that of all steps, in the cell's channel and frequency band,
    None where no cell was given or the cell is the whole recording; ``chance``: share of time shifts of the same cell
    by which it would have been at least 1.
    """

    channel: bool
    any_channel: bool
    lift: float | None
    chance: float | None


def hit(row: Row, inputs: Mapping[str, np.ndarray], step: float) -> Hit:
    """Compare the places of a verdict with the sealed gap.

    Parameters
    ----------
    inputs
        Inputs of the recording by name, each (steps,): regimes are rules on them.
    step
        Of the recording [s].
    """
    places = row.outcome.verdict.where if row.outcome.verdict is not None and row.found else []
    largest = max(row.gap.values())
    right = {name for name, gap in row.gap.items() if gap >= SAME * largest}
    first = next((one for one in places if one.kind == "cell" and one.channel in row.gap), None)
    lift, chance = (None, None) if first is None else lifted(row, first, inputs, step)
    return Hit(
        channel=bool(places) and places[0].kind != "source" and places[0].channel in right,
        any_channel=any(one.channel in right for one in places if one.kind != "source"),
        lift=lift,
        chance=chance,
    )


def inputs_of(recording: Path) -> dict[str, np.ndarray]:
    """The inputs in a recording whose hash was published, each (steps,) [unit of the system description].

    Raises
    ------
    RecordingError
        If it cannot be read.
    """
    try:
        with xr.open_dataset(recording, decode_times=False, engine="scipy") as data:
            return {
                str(name): values.values.astype(float)
                for name, values in data.data_vars.items()
                if values.attrs.get("role") == "input"
            }
    except Exception as error:  # scipy reads NetCDF in Python, and raises whatever it meets in a damaged file
        raise RecordingError(f"{recording}: cannot be read as NetCDF ({why(error)}); expected a recording") from None


def lifted(row: Row, place: Place, inputs: Mapping[str, np.ndarray], step: float) -> tuple[float | None, float | None]:
    """Lift of a cell and its chance; see :class:`Hit`."""
    gap = row.difference[place.channel]
    parts = split(gap[None], step)
    band = place.cell.get("band", "all")
    power = parts[band][0] ** 2 if band in parts else gap**2
    base = {name: np.array(series) for name, series in row.answer["base"].items()}
    mask = steps_of(place.cell, row.answer["start"], step, len(gap), {**base, **inputs})
    if mask is None or mask.all() or not mask.any() or not power.any():
        return None, None
    shifts = np.unique(np.linspace(1, len(gap) - 1, min(SHIFTS, len(gap) - 1)).round().astype(int))
    others = [float(power[np.roll(mask, int(k))].mean()) for k in shifts]
    return float(power[mask].mean() / power.mean()), float(np.mean(np.array(others) >= power.mean()))


def steps_of(
    cell: Mapping[str, str], start: float, step: float, steps: int, series: Mapping[str, np.ndarray]
) -> np.ndarray | None:
    """Steps that a cell means, shape (steps,); None where its words cannot be read. Time zero is a Monday."""
    middle = start + step * (np.arange(steps) + 0.5)
    mask = np.ones(steps, dtype=bool)
    hours = cell.get("hours", "any")
    if hours != "any":
        first, last = (float(one[:2]) + float(one[3:5]) / 60.0 for one in hours.split("-"))
        hour = middle % DAY / HOUR
        mask &= (hour >= first) & (hour < last)
    kind = cell.get("day_type", "any")
    if kind != "any":
        weekend = np.floor(middle / DAY).astype(int) % 7 >= 5
        mask &= weekend if kind == "weekend" else ~weekend
    rule = cell.get("rule", "always")
    if rule != "always":
        # of a name and a longer one that begins with it, only one is followed by a sign
        rests = {name: _RULE.fullmatch(rule.removeprefix(name)) for name in series if rule.startswith(name)}
        read = [(name, found) for name, found in rests.items() if found is not None]
        if len(read) != 1:
            return None
        ((name, found),) = read
        mask &= _SIGNS[found["sign"]](series[name], float(found["value"]))
    return mask


WITHHELD = "withheld"
"""Stratum of recordings whose only cause was withheld from the library."""
VISIBLE = 1.0
"""Root mean square of the gap over the standard deviation of one reading's noise, from which a gap can be seen."""
QUANTILE = 0.95


@dataclass(frozen=True)
class Row:
    """One recording.

    ``truth`` is the right verdict and ``effects`` the candidates that are right; ``size`` is the largest amplitude over
    its scale; ``visible`` the channels in which the gap can be expected to be seen. ``answer`` is what was sealed.
    """

    answer: dict[str, Any]
    outcome: Outcome
    stratum: str
    truth: str
    effects: tuple[str, ...]
    size: float | None
    visible: tuple[str, ...] = ()

    @property
    def single(self) -> bool:
        """Whether the right answer is one effect."""
        return self.truth == "effect" and len(self.effects) == len(self.answer["causes"]) == 1

    @property
    def true_sizes(self) -> dict[str, float]:
        """Amplitudes of the causes that act by their candidates' own laws: another law has another unit, as a rule."""
        return {one["effect"]: float(one["amplitude"]) for one in self.answer["causes"] if not one["form"]}

    @property
    def found(self) -> bool:
        """Whether a gap was found."""
        return self.outcome.verdict is not None and self.outcome.verdict.verdict != "no_gap"

    @property
    def best(self) -> str:
        """The effect that was named first; empty if none was."""
        return "" if self.outcome.verdict is None else self.outcome.verdict.best

    @property
    def named(self) -> tuple[str, ...]:
        """All effects of the answer."""
        verdict = self.outcome.verdict
        named = verdict is not None and verdict.verdict in ("effect", "ambiguous")
        return tuple(verdict.named) if verdict is not None and named else ()

    @property
    def only_true_added(self) -> bool:
        """Whether all that was fitted is a true cause; in a set that cannot be told apart it may be another member.

        Not told of verdicts of programs that did not say what was fitted.
        """
        verdict = self.outcome.verdict
        return verdict is not None and bool(verdict.chosen) and set(verdict.chosen) <= set(self.effects)

    @property
    def top(self) -> bool:
        """Whether the first named is right."""
        return self.best in self.effects

    @property
    def covered(self) -> bool:
        """Whether all that is right is named."""
        return bool(self.effects) and set(self.effects) <= set(self.named)

    @property
    def right(self) -> bool:
        """Whether the verdict is right: the first named effect, or that it is none, or that there is no gap."""
        return self.top if self.truth == "effect" else self.outcome.answer == self.truth

    @property
    def declared(self) -> bool:
        """Whether the diagnosis itself declared an effect of this amplitude to be seen, whatever it then found.

        Only of a candidate's own form: another form's amplitude may be of another kind.
        """
        verdict = self.outcome.verdict
        if verdict is None or not self.single or self.stratum != "library":
            return False
        least = verdict.smallest.get(self.effects[0])
        return least is not None and abs(self.answer["causes"][0]["amplitude"]) >= least

    @property
    def gap(self) -> dict[str, float]:
        """Sealed gap over noise by channel."""
        return dict(self.answer["gap_over_noise"])

    @property
    def length(self) -> float | None:
        """Sealed length of the gap beyond what parameters and nuisance imitate [standard deviations of the noise]."""
        sealed = self.answer.get("detectability")
        return None if sealed is None else float(sealed["length"])

    @cached_property
    def difference(self) -> dict[str, np.ndarray]:
        """Sealed noise-free record minus base model with the true parameters, each (steps,) [unit of the channel]."""
        base = self.answer["base"]
        return {name: np.array(clean) - np.array(base[name]) for name, clean in self.answer["clean"].items()}


@dataclass(frozen=True)
class LeftOut:
    """A recording of one effect, diagnosed without it.

    ``again`` is false where the first verdict had given it no chance and so stands; ``alike`` are the candidates that
    it was declared to be confusable with.
    """

    row: Row
    outcome: Outcome
    again: bool
    alike: tuple[str, ...]

    @property
    def none(self) -> bool:
        """Whether the answer is none of these."""
        return self.outcome.answer == "none_of_these"

    @property
    def none_or_alike(self) -> bool:
        """The same, or all that is named is confusable with what was withheld."""
        verdict = self.outcome.verdict
        if verdict is None or verdict.verdict not in ("effect", "ambiguous"):
            return self.none
        return bool(verdict.named) and set(verdict.named) <= set(self.alike)


def side_by_side(opened: dict[str, Any], results: Path | str, run: Run, first: int | None = None) -> list[Row]:
    """Join answers and verdicts.

    Parameters
    ----------
    first
        How many recordings, from the beginning of the set; all if not given. What can be seen is that of the whole
        set either way: it needs no verdict.

    Raises
    ------
    RecordingError
        If the verdict on a recording is missing, or on another one.
    """
    rows = []
    for answer in opened["recordings"][:first]:
        outcome = read_outcome(results, answer["file"])
        if outcome.file != answer["file"]:
            raise RecordingError(f"{results}: found the verdict on {outcome.file}; expected that on {answer['file']}")
        check_program(results, outcome, run)
        effects = tuple(name for name in answer["effects"] if name not in run.without)
        stratum, truth = answer["stratum"], answer["verdict"]
        if truth == "effect" and not effects:
            stratum, truth = WITHHELD, "none_of_these"
        sizes = [abs(one["amplitude"]) / one["scale"] for one in answer["causes"]]
        rows.append(Row(answer, outcome, stratum, truth, effects, max(sizes, default=None)))
    limits = structural(opened["recordings"])
    return [replace(row, visible=visible(row, limits)) for row in rows]


Limits = dict[tuple[bool, str], float]


def structural(answers: Sequence[dict[str, Any]], quantile: float = QUANTILE) -> Limits:
    """Gap over noise that recordings without any effect have, by (replay, channel): walls and sampling of the truth.

    A quantile (the higher of its neighbours: of twenty or fewer, the largest).
    Where no recording without effect has these actuators, all of them count.

    Parameters
    ----------
    answers
        Of all recordings of the set, also of those that nobody diagnosed.
    """
    none = [one for one in answers if one["verdict"] == "no_gap"]
    found: Limits = {}
    for replay in (False, True):
        like = [one for one in none if one["replay"] == replay] or none
        for channel in answers[0]["gap_over_noise"] if answers else []:
            gaps = [one["gap_over_noise"][channel] for one in like]
            found[replay, channel] = float(np.quantile(gaps, quantile, method="higher")) if gaps else 0.0
    return found


def visible(row: Row, limits: Limits) -> tuple[str, ...]:
    """Channels in which a gap can be expected to be seen.

    By definition, fixed before any verdict is looked at: those where the root mean square of the sealed gap is at
    least the noise of one reading, and larger than in 95 % of the recordings of the set without any effect.
    """
    if row.truth == "no_gap":
        return ()
    return tuple(k for k, gap in row.gap.items() if gap >= VISIBLE and gap > limits[row.answer["replay"], k])


def left_out(rows: Sequence[Row], results: Path | str) -> list[LeftOut]:
    """Recordings of one effect of the library, diagnosed without it; empty where that was not asked for.

    Raises
    ------
    RecordingError
        If one of these verdicts is on another recording, or of another program.
    """
    found = []
    for row in rows:
        again = read_withheld(results, row.answer["file"]) if row.single else None
        if again is None:
            continue
        for one in again.outcomes.values():
            if one.program != row.outcome.program and "" not in (one.program, row.outcome.program):
                raise RecordingError(
                    f"{results}: found a verdict of program {one.program[:12]} on {one.file} with effects withheld;"
                    f" expected {row.outcome.program[:12]}, that of the verdict with all"
                )
            if (one.file, one.sha256) != (row.outcome.file, row.outcome.sha256):
                raise RecordingError(
                    f"{results}: found a verdict on {one.file} ({one.sha256}) among those on {row.answer['file']} with"
                    f" effects withheld; expected {row.outcome.sha256}"
                )
        name = row.effects[0]
        outcome = again.outcomes.get(name, row.outcome)
        said = row.outcome.verdict or outcome.verdict
        alike = tuple(said.alike.get(name, ())) if said is not None else ()
        found.append(LeftOut(row, outcome, name in again.outcomes, alike))
    return found
