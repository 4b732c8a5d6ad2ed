"""Whether a gap lies where the diagnosis said: reported channel and cell against the sealed series."""

from __future__ import annotations

import operator
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from diagnosis.blind.opened import Row
from diagnosis.blind.verdicts import Place
from diagnosis.where.bands import split
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
