"""Which days a calibration has seen, so that no forecast of them passes for one: days are known by their readings.

Neither a path nor where a recording begins tells: copies have other paths, and cuts other beginnings and lengths.
"""

from __future__ import annotations

import hashlib
from itertools import pairwise
from pathlib import Path

import numpy as np

from diagnosis.calibrating.schema import Calibration, Day
from diagnosis.recording import HOUR, Recording
from shared.errors import RecordingError

NEAR = 1e-3
"""Steps that begin within this share of one are the same."""


def days_of(recording: Recording) -> list[Day]:
    """The days of a recording by its own clock, the first and the last as far as they reach.

    Days on which no output moves are left out: they are alike in recordings that have nothing to do with each other.
    """
    begins = _begins(recording)
    date = begins.astype("datetime64[D]")
    edges = [0, *(np.flatnonzero(date[1:] != date[:-1]) + 1).tolist(), len(date)]
    return [
        Day(begin=str(begins[a]), steps=b - a, sha256=_hash(recording.outputs[:, a:b]))
        for a, b in pairwise(edges)
        if _moves(recording.outputs[:, a:b])
    ]


def check_unseen(report: Calibration, record: Recording, split: int, end: int) -> None:
    """Refuse a calibration that has seen any of the steps ``split`` to ``end``: scores would be those of a fit.

    It has if it was made from this file, or from any day of it, and reaches there.

    Raises
    ------
    RecordingError
        Naming the first day that was seen.
    """
    begins = _begins(record)
    same = Path(report.recording).resolve() == record.path.resolve()
    same = same or any(_is_in(day, report.step, record, begins[0]) for day in report.days)
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


def _is_in(day: Day, step: float, record: Recording, begin: np.datetime64) -> bool:
    """Whether a recording has the readings of a day at the time of that day."""
    if abs(step - record.step) > NEAR * step:
        return False
    first = float((np.datetime64(day.begin, "s") - begin) / np.timedelta64(1, "s")) / step
    at = round(first)
    if abs(first - at) * step > 1.0 or at < 0 or at + day.steps > len(record.time):
        return False
    return _hash(record.outputs[:, at : at + day.steps]) == day.sha256


def _first_ahead(day: Day, step: float, ahead: np.ndarray) -> np.datetime64 | None:
    """The first of the steps ahead that lies in a day as far as it was seen; None if none does."""
    begin = np.datetime64(day.begin, "s")
    inside = (ahead >= begin) & (ahead < begin + np.timedelta64(round(day.steps * step), "s"))
    return np.datetime64(ahead[np.argmax(inside)], "m") if inside.any() else None


def _hash(outputs: np.ndarray) -> str:
    """The sha256 of readings (outputs, steps), as single precision holds them: files are often written so."""
    readings = np.where(np.isfinite(outputs), outputs, np.nan).astype(np.float32) + np.float32(0)  # no negative zeros
    return hashlib.sha256(np.ascontiguousarray(readings, dtype="<f4").tobytes()).hexdigest()


def _moves(outputs: np.ndarray) -> bool:
    """Whether any output reads more than one value."""
    return any(len(np.unique(row[np.isfinite(row)])) > 1 for row in outputs)
