"""Readings that can be compared with a training's: codes for missing ones, constant channels, units."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.codes import CODES
from shared.errors import RecordingError
from trainer.predicting.readings import check_gaps, comparable
from trainer.reading.encoding import Encoding


def encoding(mean, sd, unit="W", constant=()):
    return SimpleNamespace(mean=[mean], sd=[sd], units=[unit], recorded=["power"], constant=list(constant))


def checked(value, told):
    values = np.full((1, 3, 1), told.mean[0])
    values[0, 1, 0] = value
    return comparable(Path("r.nc"), values, np.zeros((1, 3)), [None], told)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("code", [-999.9, 99999.0])
def test_a_code_within_thirty_standard_deviations_is_one(code, dtype):
    told = encoding(700.0, abs(code - 700.0) / 6)
    with pytest.raises(RecordingError, match=r"power is -?9.* W at .*, as loggers write where a reading is missing"):
        checked(dtype(code), told)


@given(st.sampled_from(CODES.tolist()), st.floats(0.1, 4.9))
def test_a_reading_that_is_common_is_no_code(code, away):
    told = encoding(code + away * 50.0, 50.0)
    assert checked(code, told)[0, 1, 0] == np.float32(code)


@pytest.mark.parametrize(
    ("holes", "largest", "sentence"),
    [
        (
            {0: 2, 1: 3},
            0.2,
            "power of system 8 has 3 missing values in its last 10 samples; expected at most 2: choose",
        ),
        ({0: 2, 1: 2}, 0.2, None),
    ],
)
def test_missing_readings_are_counted_in_the_window_that_has_most(holes, largest, sentence):
    values = np.ones((2, 10))
    for system, count in holes.items():
        values[system, :count] = np.nan
    if sentence is None:
        check_gaps(Path("r.nc"), "power", values, [4, 8], largest)
        return
    with pytest.raises(RecordingError, match=sentence):
        check_gaps(Path("r.nc"), "power", values, [4, 8], largest)


def test_temperatures_in_degrees_are_refused_however_wide_the_training_was(tmp_path):
    """283 K with a spread of 10 K: 10 degC are 27 standard deviations away, and yet no such temperature exists."""
    encoding = Encoding(
        recorded=["air"],
        outputs=1,
        units=["K"],
        derived=[],
        step=3600.0,
        length=3,
        mean=[283.0],
        sd=[10.0],
        parameters=["k"],
        parameter_units=["1"],
        parameter_min=[1.0],
        parameter_max=[2.0],
        target_mean=[0.1],
        target_sd=[0.1],
    )
    values = np.array([[[10.0], [11.0], [12.0]]], dtype=np.float32)
    times = np.array([[3600.0, 7200.0, 10800.0]])
    with pytest.raises(
        RecordingError, match=r"air is 10 K at 2001-01-01T01:00:00, 27 standard deviations .* at most 13"
    ):
        comparable(tmp_path / "r.nc", values, times, [None], encoding)


@pytest.mark.parametrize("unit", ["K", "kelvin"])
def test_a_set_point_that_is_a_quarter_of_a_degree_off_is_not_a_rounding(unit):
    """A thousandth of 293.15 K is 0.29 K: 20.25 degC had been read as 20 without a word."""
    told = encoding(293.15, 1.0, unit, ["power"])
    assert checked(293.2, told)[0, 1, 0] == np.float32(293.15)
    for other in (293.40, 293.0):
        with pytest.raises(RecordingError, match=rf"power is {other:g} .*; in the run's training it was 293\.15 "):
            checked(other, told)
    difference = encoding(8.0, 1.0, unit, ["power"])
    with pytest.raises(RecordingError, match="in the run's training it was 8"):
        checked(8.05, difference)
