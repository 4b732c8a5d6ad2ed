"""Stretches of a recording: where everything that is needed has a value, and which of them is taken."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Group, Parameter

from shared.errors import RecordingError
from shared.logs import logger

DAY = 86400.0
"""A stretch is at least so long [s]: a day is the least that a fit or an estimator reads."""
LEAST = 2
"""Steps of a stretch, of which a recording has two at least."""
LISTED = 12
"""So many stretches are listed in a sentence, the longest."""
_PANEL = Group("Stretch")
_DATE_ALONE = 10
"""Characters of a date without a time of day."""
_log = logger(__name__)


@Parameter(name="*")
@dataclass(frozen=True)
class Stretch:
    """Which stretch of a recording with gaps in its inputs is taken: by number, or by dates; without any, the longest.

    Dates are by the recording's clock. The longest stretch between them is taken, cut where they say.
    """

    number: Annotated[
        int | None,
        Parameter(name="--stretch", group=_PANEL, help="Number of the stretch without gaps to take; else the longest."),
    ] = None
    begin: Annotated[
        str | None,
        Parameter(name="--from", group=_PANEL, help="Take nothing before this date (2021-03-08, or with a time)."),
    ] = None
    end: Annotated[
        str | None, Parameter(name="--to", group=_PANEL, help="Take nothing after this date; a date alone is included.")
    ] = None


LONGEST = Stretch()
"""The choice of whoever makes none."""


@dataclass(frozen=True)
class Steps:
    """The steps of a recording: its ``path``, their ``ends`` (steps,) as dates to the second, and their length [s]."""

    path: Path
    ends: np.ndarray
    step: float

    def text(self, first: int, after: int) -> str:
        """From when until when some steps are, and how long that is."""
        begin = self.ends[first] - np.timedelta64(round(self.step), "s")
        said = [str(one.astype("datetime64[m]")).replace("T", " ") for one in (begin, self.ends[after - 1])]
        return f"{said[0]} to {said[1]} ({(after - first) * self.step / 3600:g} h)"


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Where a mask is true on end, as (first, one past the last)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def bridge(values: np.ndarray, longest: int) -> np.ndarray:
    """Put in what is missing by lines where at most so many values are missing in a row; nothing at the ends.

    ``values`` (steps,), NaN where missing, are changed in place. Returns where values were put in, (steps,).
    """
    missing = ~np.isfinite(values)
    filled = np.zeros(len(values), dtype=bool)
    for first, after in runs(missing):
        if first > 0 and after < len(values) and after - first <= longest:
            filled[first:after] = True
    if filled.any():
        values[filled] = np.interp(np.flatnonzero(filled), np.flatnonzero(~missing), values[~missing])
    return filled


def stretches(whole: np.ndarray, step: float) -> list[tuple[int, int]]:
    """Stretches of at least a day, in order, of steps (steps,) of ``step`` [s] of which some are ``whole``."""
    return [(a, b) for a, b in runs(whole) if b - a >= LEAST and (b - a) * step >= DAY - 1e-6 * step]


def chosen(
    steps: Steps,
    known: Mapping[str, np.ndarray],
    choice: Stretch | None,
    without: Mapping[str, str] | None = None,
    *,
    said: bool = True,
) -> tuple[int, int]:
    """The steps that are taken, as (first, one past the last); a recording without gaps is taken whole, however short.

    ``known`` is where each series that is needed has a value, by name, (steps,) each; ``without`` what to write so that
    a series is not needed. If ``said``, what is there and what is taken is logged: as a warning where nobody chose and
    a day or more is left out. Raises RecordingError if there is no stretch of a day, or not the one that was chosen.
    """
    choice = choice or LONGEST
    count = len(steps.ends)
    whole = np.all([np.ones(count, dtype=bool), *known.values()], axis=0)
    if whole.all() and choice == LONGEST:
        return 0, count
    found = [(0, count)] if whole.all() else stretches(whole, steps.step)
    if not found:
        raise RecordingError(_none_at_all(steps, known, without or {}))
    numbered = dict(enumerate(found, 1))
    listed = sorted(sorted(numbered, key=lambda k: found[k - 1][0] - found[k - 1][1])[:LISTED])
    more = f", and {len(found) - len(listed)} shorter ones" if len(found) > len(listed) else ""
    listing = "; ".join(f"{k}: {steps.text(*numbered[k])}" for k in listed) + more
    if choice.number is not None:
        if choice.begin is not None or choice.end is not None:
            raise RecordingError("--stretch is given together with --from or --to; expected a number, or dates")
        if choice.number not in numbered:
            raise RecordingError(f"{steps.path}: has no stretch {choice.number}; expected one of {listing}")
        taken, number = numbered[choice.number], choice.number
    else:
        first, after = _between(steps, choice)
        cut = {k: (max(a, first), min(b, after)) for k, (a, b) in numbered.items()}
        number = max(cut, key=lambda k: cut[k][1] - cut[k][0])
        taken = cut[number]
        if (taken[1] - taken[0]) * steps.step < DAY - 1e-6 * steps.step and taken != numbered[number]:
            raise RecordingError(
                f"{steps.path}: has less than a day without gaps between the dates of --from and --to; expected dates"
                f" that hold a day of one stretch: {listing}"
            )
    if not said:
        return taken
    gaps = ", ".join(name for name, there in known.items() if not there.all())
    about = f" without gaps in {gaps}" if gaps else ""
    how = f"taken is {steps.text(*taken)}"
    if choice == LONGEST and len(found) > 1:
        how += ", the longest; --stretch, or --from and --to, take another"
    much = (count - taken[1] + taken[0]) * steps.step >= DAY
    tell = _log.warning if choice == LONGEST and much else _log.info
    there_are = (
        f"{len(found)} stretches{about}: {listing}" if len(found) > 1 else f"one stretch of a day or more{about}"
    )
    tell("%s: has %s; %s", steps.path, there_are, how)
    return taken


def _between(steps: Steps, choice: Stretch) -> tuple[int, int]:
    """The steps between the dates of a choice."""
    first, after = 0, len(steps.ends)
    if choice.begin is not None:
        begin = _date(choice.begin, "--from")
        first = int(np.searchsorted(steps.ends - np.timedelta64(round(steps.step), "s"), begin))
    if choice.end is not None:
        end = _date(choice.end, "--to")
        end = end + np.timedelta64(1, "D") if len(choice.end.strip()) == _DATE_ALONE else end
        after = int(np.searchsorted(steps.ends, end, side="right"))
    return first, max(after, first)


def _date(text: str, option: str) -> np.datetime64:
    try:
        found: np.datetime64 | None = np.datetime64(text.strip().replace(" ", "T"), "s")
    except ValueError:
        found = None
    if found is None or np.isnat(found):
        raise RecordingError(
            f"{option} is {text!r}; expected a date by the recording's clock, such as 2021-03-08 or '2021-03-08 06:00'"
        )
    return found


def _none_at_all(steps: Steps, known: Mapping[str, np.ndarray], without: Mapping[str, str]) -> str:
    """Why there is no stretch: how much each series lacks, and which are in the way of one."""
    lacking = {name: int((~there).sum()) for name, there in known.items() if not there.all()}
    gaps = ", ".join(f"{name} in {count}" for name, count in lacking.items())
    always = np.ones(len(steps.ends), dtype=bool)

    def of(names: Iterable[str]) -> np.ndarray:
        return np.asarray(np.all([always, *(known[name] for name in names)], axis=0))

    longest = max((b - a for a, b in runs(of(known))), default=0) * steps.step / 3600
    freed = [name for name in lacking if stretches(of(known.keys() - {name}), steps.step)]
    said = [f"{name} ({without[name]})" if name in without else name for name in freed]
    hint = f"; without {' or '.join(said)} there would be one" if said else ""
    return (
        f"{steps.path}: the longest stretch without gaps has {longest:.3g} h ({gaps} of {len(always)} steps have no"
        f" value){hint}; expected a day at least: what the mapping of `diagnosis import` says under fill may fill gaps"
    )
