"""Which days a calibration has seen, so that no forecast of them passes for one: days are known by their readings.

Neither a path nor where a recording begins tells: copies have other paths, and cuts other beginnings and lengths. Nor
need the same log be imported the same way: with other outputs, with a reading more or less of one, or with other steps.
So a day is known by any one output, and at steps that divide an hour by its readings at full hours: those of an
instant are the same at all such steps (those of a mean are not).
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from diagnosis.calibrating.schema import Calibration, Day
from diagnosis.recording import HOUR, Recording
from shared.errors import RecordingError

NEAR = 1e-3
"""Steps are the same that differ by less than this share."""
TELLING = 8
"""So many different readings of a day tell it from others, or as many as a shorter one has: a flow by timetable is the
same in many rooms."""


def days_of(recording: Recording, names: Sequence[str]) -> list[Day]:
    """The days of a recording by its own clock, the first and the last as far as they reach.

    Outputs, whose names are ``names``, are left out where they hardly move: then they are alike in recordings that have
    nothing to do with each other. So are days without any other.
    """
    begins = _begins(recording)
    date = begins.astype("datetime64[D]")
    edges = [0, *(np.flatnonzero(date[1:] != date[:-1]) + 1).tolist(), len(date)]
    made = [
        Day(begin=str(begins[a]), steps=b - a, sha256=_hashes(recording, names, slice(a, b)))
        for a, b in pairwise(edges)
    ]
    return [one for one in made if one.sha256]


def check_unseen(report: Calibration, record: Recording, names: Sequence[str], split: int, end: int) -> None:
    """Refuse a calibration that has seen any of the steps ``split`` to ``end``: scores would be those of a fit.

    It has if it was made from this file, or from any day of it, and reaches there. ``names`` are those of the outputs.

    Raises
    ------
    RecordingError
        Naming the first day that was seen.
    """
    begins = _begins(record)
    same = Path(report.recording).resolve() == record.path.resolve()
    same = same or any(_is_in(day, report.step, record, names) for day in report.days)
    if not same or not report.days:
        return
    seen = [at for day in report.days if (at := _first_ahead(day, report.step, begins[split:end])) is not None]
    if seen:
        raise RecordingError(
            f"{record.path}: {str(min(seen)).replace('T', ' ')} and what follows is to be forecast, but is among what"
            f" the given calibration was made from ({report.recording}); expected one that has seen none of the"
            f" {(end - split) * record.step / HOUR:g} h ahead, or none, to calibrate on the context"
        )


def _begins(recording: Recording) -> np.ndarray:
    """When steps begin, by the recording's clock, to the second, shape (steps,)."""
    seconds = np.round(recording.time - recording.step).astype("timedelta64[s]")
    return np.asarray(recording.zero.astype("datetime64[s]") + seconds)


def _is_in(day: Day, step: float, record: Recording, names: Sequence[str]) -> bool:
    """Whether a recording has the readings that a day had in one of steps of ``step`` [s], of any output."""
    same = abs(step - record.step) <= NEAR * step
    if not same and not (_divides_an_hour(step) and _divides_an_hour(record.step)):
        return False
    begin, span = np.datetime64(day.begin, "s"), np.timedelta64(round(day.steps * step), "s")
    begins = _begins(record)
    inside = np.flatnonzero((begins >= begin) & (begins < begin + span))
    if len(inside) != round(day.steps * step / record.step) or begins[inside[0]] != begin:
        return False
    found = _hashes(record, names, slice(int(inside[0]), int(inside[-1]) + 1))
    return any(found.get(name) == one for name, one in day.sha256.items())


def _first_ahead(day: Day, step: float, ahead: np.ndarray) -> np.datetime64 | None:
    """The first of the steps ahead that lies in a day as far as it was seen; None if none does."""
    begin = np.datetime64(day.begin, "s")
    inside = (ahead >= begin) & (ahead < begin + np.timedelta64(round(day.steps * step), "s"))
    return np.datetime64(ahead[np.argmax(inside)], "m") if inside.any() else None


def _divides_an_hour(step: float) -> bool:
    return abs(HOUR / step - round(HOUR / step)) < NEAR


def _hashes(record: Recording, names: Sequence[str], part: slice) -> dict[str, str]:
    """The sha256 of the readings of each output that moves, as single precision holds them: files are often so."""
    ends = np.round(record.time[part])
    full = ends % HOUR == 0
    told = full if _divides_an_hour(record.step) and full.any() else np.ones(len(ends), dtype=bool)
    found = {}
    for name, row in zip(names, record.outputs[:, part][:, told], strict=True):
        seen = row[np.isfinite(row)]
        if len(np.unique(seen)) < max(2, min(TELLING, len(row))):
            continue
        readings = np.where(np.isfinite(row), row, np.nan).astype(np.float32) + np.float32(0)  # no negative zeros
        found[name] = hashlib.sha256(np.ascontiguousarray(readings, dtype="<f4").tobytes()).hexdigest()
    return found
