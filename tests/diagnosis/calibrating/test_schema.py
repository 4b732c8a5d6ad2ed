"""Calibrations know the days that they have seen, whatever file these are forecast from."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.calibrating.schema import check_unseen, days_of
from diagnosis.recording import HOUR, Recording
from shared.errors import RecordingError

NAMES = ("one", "two")
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


def calibrated(record, names=NAMES):
    return SimpleNamespace(recording=str(record.path), step=record.step, days=days_of(record, names))


def test_days_are_those_of_the_clock_and_still_outputs_do_not_tell_them():
    record = month(hours=4 * 24)
    record.outputs[:, 14 : 14 + 24] = 3.0
    record.outputs[1, 14 + 24 : 14 + 48] = np.nan
    assert [(day.begin, day.steps, sorted(day.sha256)) for day in days_of(record, NAMES)] == [
        ("2022-01-03T10:00:00", 14, ["one", "two"]),
        ("2022-01-04T00:00:00", 24, []),
        ("2022-01-05T00:00:00", 24, ["one"]),
        ("2022-01-06T00:00:00", 24, ["one", "two"]),
        ("2022-01-07T00:00:00", 10, ["one", "two"]),
    ]
    still = replace(record, outputs=np.full_like(record.outputs, np.nan))
    assert [day.sha256 for day in days_of(still, NAMES)] == [{}] * 5


def coarse(path="coarse.nc", *, hours=28 * 24):
    """One output by a thermometer of half a kelvin: no day has eight different readings."""
    time = HOUR * np.arange(1, hours + 1)
    outputs = 20 + np.round(0.6 * np.sin(2 * np.pi * time / (24 * HOUR)) / 0.5)[None] * 0.5
    return Recording(Path(path), HOUR, time, outputs, {}, MONDAY)


def test_a_coarse_thermometer_hides_no_day_of_the_same_file():
    record = coarse()
    assert not any(day.sha256 for day in days_of(record, NAMES[:1]))
    with pytest.raises(RecordingError, match="2022-01-10 00:00 and what follows is to be forecast"):
        check_unseen(calibrated(record, NAMES[:1]), record, NAMES[:1], 168, 504)
    check_unseen(
        calibrated(replace(record, outputs=record.outputs[:, :168], time=record.time[:168]), NAMES[:1]),
        record,
        NAMES[:1],
        168,
        504,
    )


def test_what_could_not_be_checked_is_said(caplog):
    report, copy = calibrated(coarse(), NAMES[:1]), coarse("copy.nc")
    with caplog.at_level("WARNING", logger="zeroshot"):
        check_unseen(report, copy, NAMES[:1], 168, 504)
    assert re.search(r"copy\.nc: whether .*\(of coarse\.nc\) has seen 2022-01-10 00:00 .* not be checked", caplog.text)
    caplog.clear()
    with caplog.at_level("WARNING", logger="zeroshot"):
        check_unseen(report, replace(copy, zero=MONDAY + np.timedelta64(364, "D")), NAMES[:1], 168, 504)  # other dates
        check_unseen(calibrated(month("one.nc")), month("two.nc", seed=1), NAMES, 168, 504)  # another room
    assert not caplog.text


@pytest.mark.parametrize(
    ("fitted", "told", "split", "end", "first"),
    [
        ((0, 672), (0, 504), 168, 504, "2022-01-10 10:00"),  # all of it, told from a shorter file
        ((168, 672), (0, 672), 168, 672, "2022-01-10 10:00"),  # a cut, told from the whole
        ((0, 169), (0, 672), 168, 504, "2022-01-10 10:00"),  # an hour too much
        ((0, 168), (0, 672), 168, 504, None),
        ((504, 672), (0, 672), 168, 504, None),  # later than what is told
    ],
)
def test_a_calibration_that_has_seen_what_is_to_be_forecast_is_refused(fitted, told, split, end, first):
    whole = month()
    report, record = calibrated(cut(whole, *fitted)), cut(whole, *told, path="copy.nc")
    record = whole if told == (0, 672) else record
    if first is None:
        check_unseen(report, record, NAMES, split, end)
        return
    with pytest.raises(RecordingError, match=rf"nc: {first} and what follows is to be forecast.*\(cut\.nc\)"):
        check_unseen(report, record, NAMES, split, end)


def calmer(record, **outputs):
    """A copy with the readings of some outputs in place of its own."""
    readings = [outputs.get(name, row) for name, row in zip(NAMES, record.outputs, strict=True)]
    return replace(record, path=Path(f"of-{record.path}"), outputs=np.array(readings))


@pytest.mark.parametrize("name", NAMES)
def test_a_log_that_was_imported_otherwise_is_what_was_seen(name):
    """With one output alone, and with a reading less of the other on each day."""
    record = month()
    alone = calmer(record, **{other: np.full(len(record.time), np.nan) for other in NAMES if other != name})
    fewer = record.outputs[NAMES.index(name)].copy()
    fewer[3::24] = np.nan
    for seen, told in ((alone, record), (record, alone), (record, calmer(record, **{name: fewer}))):
        with pytest.raises(RecordingError, match="2022-01-10 10:00 and what follows is to be forecast"):
            check_unseen(calibrated(seen), told, NAMES, 168, 504)


def test_days_to_come_without_a_reading_have_not_been_seen():
    """As `diagnosis import --ahead` makes them: weather goes on where outputs end, here at five in the afternoon."""
    record = month()
    record.outputs[:, :2] = record.outputs[:, 168 + 7 :] = np.nan
    report = calibrated(record)
    assert (report.days[0].begin, report.days[0].steps) == ("2022-01-03T12:00:00", 12)
    assert (report.days[-1].begin, report.days[-1].steps) == ("2022-01-10T00:00:00", 17)
    for path in ("whole.nc", "copy.nc"):
        check_unseen(report, replace(record, path=Path(path)), NAMES, 168 + 7, 504)
        check_unseen(report, replace(month(), path=Path(path)), NAMES, 168 + 7, 504)  # read in the meantime
        with pytest.raises(RecordingError, match="2022-01-10 16:00 and what follows is to be forecast"):
            check_unseen(report, replace(record, path=Path(path)), NAMES, 168 + 6, 504)
