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
from shared.logs import logger

_log = logger(__name__)
NEAR = 1e-3
"""Steps are the same that differ by less than this share."""
TELLING = 8
"""So many different readings of a day tell it from others, or as many as a shorter one has: a flow by timetable is the
same in many rooms."""


def days_of(recording: Recording, names: Sequence[str]) -> list[Day]:
    """The days of a recording by its own clock, from the first to the last reading of any output.

    Steps beyond, of weather to come, say, tell a fit nothing and have not been seen.
    Outputs, whose names are ``names``, have no hash where they hardly move: then they are alike in recordings that have
    nothing to do with each other. A day without any hash was fitted all the same, and is known by its neighbours.
    """
    begins = _begins(recording)
    read = np.flatnonzero(np.isfinite(recording.outputs).any(axis=0))
    first, after = (int(read[0]), int(read[-1]) + 1) if read.size else (0, len(begins))
    date = begins[first:after].astype("datetime64[D]")
    edges = [first, *(first + np.flatnonzero(date[1:] != date[:-1]) + 1).tolist(), after]
    return [
        Day(begin=str(begins[a]), steps=b - a, sha256=_hashes(recording, names, slice(a, b)))
        for a, b in pairwise(edges)
    ]


def check_unseen(report: Calibration, record: Recording, names: Sequence[str], split: int, end: int) -> None:
    """Refuse a calibration that has seen any of the steps ``split`` to ``end``: scores would be those of a fit.

    It has if it was made from this file, or from any day of it, and reaches there: all that lies between the first and
    the last day of a calibration was fitted. Where no day of it can be told from those of other recordings, and its
    dates are among those ahead, a warning says that nothing could be checked. ``names`` are those of the outputs.

    Raises
    ------
    RecordingError
        Naming the first step that was seen.
    """
    begin, after = _span(report)
    ahead = _begins(record)[split:end]
    seen = ahead[(ahead >= begin) & (ahead < after)]
    if not len(seen):
        return
    first = str(seen[0].astype("datetime64[m]")).replace("T", " ")
    known = [_is_in(day, report.step, record, names) for day in report.days]
    if _same_file(report, record) or any(known):
        raise RecordingError(
            f"{record.path}: {first} and what follows is to be forecast, but is among what"
            f" the given calibration was made from ({report.recording}); expected one that has seen none of the"
            f" {(end - split) * record.step / HOUR:g} h ahead, or none, to calibrate on the context"
        )
    if all(one is None for one in known):
        _log.warning(
            "%s: whether the given calibration (of %s) has seen %s and what follows could not be checked: no day that"
            " both have can be told by its readings, and by their dates it may have",
            record.path,
            report.recording,
            first,
        )


def _same_file(report: Calibration, record: Recording) -> bool:
    return Path(report.recording).resolve() == record.path.resolve()


def _span(report: Calibration) -> tuple[np.datetime64, np.datetime64]:
    """From when until when a calibration has seen readings, by its recording's clock."""
    first, last = report.days[0], report.days[-1]
    after = np.datetime64(last.begin, "s") + np.timedelta64(round(last.steps * report.step), "s")
    return np.datetime64(first.begin, "s"), after


def _begins(recording: Recording) -> np.ndarray:
    """When steps begin, by the recording's clock, to the second, shape (steps,)."""
    seconds = np.round(recording.time - recording.step).astype("timedelta64[s]")
    return np.asarray(recording.zero.astype("datetime64[s]") + seconds)


def _is_in(day: Day, step: float, record: Recording, names: Sequence[str]) -> bool | None:
    """Whether a recording has the readings that a day had in one of steps of ``step`` [s], of any output.

    None where nothing tells: it has no such day, or no output whose readings could be compared.
    """
    same = abs(step - record.step) <= NEAR * step
    if not day.sha256 or (not same and not (_divides_an_hour(step) and _divides_an_hour(record.step))):
        return None
    begin, span = np.datetime64(day.begin, "s"), np.timedelta64(round(day.steps * step), "s")
    begins = _begins(record)
    inside = np.flatnonzero((begins >= begin) & (begins < begin + span))
    if not len(inside) or len(inside) != round(day.steps * step / record.step) or begins[inside[0]] != begin:
        return None
    found = _hashes(record, names, slice(int(inside[0]), int(inside[-1]) + 1))
    compared = [found[name] == one for name, one in day.sha256.items() if name in found]
    return any(compared) if compared else None


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
