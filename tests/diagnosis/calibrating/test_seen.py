"""Calibrations know the days that they have seen, whatever file these are forecast from."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.calibrating.seen import check_unseen, days_of
from diagnosis.recording import HOUR, Recording
from shared.errors import RecordingError

MONDAY = np.datetime64("2022-01-03", "s")


def month(path="whole.nc", *, seed=0, hours=28 * 24, first=10):
    """A recording by the hour that begins on a Monday at ten."""
    rng = np.random.default_rng(seed)
    time = HOUR * (first + np.arange(1, hours + 1))
    outputs = 20 + rng.standard_normal((2, hours))
    outputs[1, ::7] = np.nan
    return Recording(Path(path), HOUR, time, outputs, {}, MONDAY)


def cut(record, first, last, path="cut.nc"):
    """Some hours of a recording as a file of their own, which counts from a Monday of its own and is single."""
    zero = MONDAY + np.timedelta64(7, "D")
    part = slice(first, last)
    outputs = record.outputs[:, part].astype(np.float32).astype(float)
    return replace(record, path=Path(path), time=record.time[part] - 7 * 24 * HOUR, outputs=outputs, zero=zero)


def calibrated(record):
    return SimpleNamespace(recording=str(record.path), step=record.step, days=days_of(record))


def test_days_are_those_of_the_clock_and_still_ones_are_left_out():
    record = month(hours=4 * 24)
    record.outputs[:, 14 : 14 + 24] = 3.0
    record.outputs[1, 14 + 24 : 14 + 48] = np.nan
    assert [(day.begin, day.steps) for day in days_of(record)] == [
        ("2022-01-03T10:00:00", 14),
        ("2022-01-05T00:00:00", 24),
        ("2022-01-06T00:00:00", 24),
        ("2022-01-07T00:00:00", 10),
    ]
    still = replace(record, outputs=np.full_like(record.outputs, np.nan))
    assert days_of(still) == []


@pytest.mark.parametrize(
    ("fitted", "told", "split", "end", "first"),
    [
        ((0, 672), (0, 504), 168, 504, "2022-01-10 10:00"),  # all of it, told from a shorter file
        ((168, 672), (0, 672), 168, 672, "2022-01-10 10:00"),  # a cut, told from the whole
        ((0, 169), (0, 672), 168, 504, "2022-01-10 10:00"),  # an hour too much
        ((300, 330), (0, 672), 168, 504, "2022-01-15 22:00"),
        ((0, 672), (200, 400), 48, 96, "2022-01-13 18:00"),
        ((0, 168), (0, 672), 168, 504, None),
        ((504, 672), (0, 672), 168, 504, None),  # later than what is told
        ((0, 72), (48, 400), 24, 96, None),
    ],
)
def test_a_calibration_that_has_seen_what_is_to_be_forecast_is_refused(fitted, told, split, end, first):
    whole = month()
    report, record = calibrated(cut(whole, *fitted)), cut(whole, *told, path="copy.nc")
    record = whole if told == (0, 672) else record
    if first is None:
        check_unseen(report, record, split, end)
        return
    with pytest.raises(RecordingError, match=rf"nc: {first} and what follows is to be forecast.*\(cut\.nc\)"):
        check_unseen(report, record, split, end)


def test_another_room_on_the_same_days_is_not_what_was_seen():
    check_unseen(calibrated(month("one.nc")), month("two.nc", seed=1), 168, 504)


def test_a_file_whose_readings_were_changed_since_is_still_the_same():
    record = month()
    changed = replace(record, outputs=record.outputs + 273.15)
    with pytest.raises(RecordingError, match=r"2022-01-10 10:00 and what follows .* none of the 336 h ahead"):
        check_unseen(calibrated(record), changed, 168, 504)
