"""Codes for missing readings among readings that are rare."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.codes import CODES
from shared.errors import RecordingError
from trainer.predicting.readings import check_gaps, comparable


def encoding(mean, sd, unit="W", constant=()):
    return SimpleNamespace(mean=[mean], sd=[sd], units=[unit], recorded=["power"], constant=list(constant))


def checked(value, told):
    values = np.full((1, 3, 1), told.mean[0])
    values[0, 1, 0] = value
    return comparable(Path("r.nc"), values, np.zeros((1, 3)), [None], told)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("code", [-9999.0, 9999.0, -999.9, 99999.0])
def test_a_code_within_thirty_standard_deviations_is_one(code, dtype):
    told = encoding(700.0, abs(code - 700.0) / 6)
    with pytest.raises(RecordingError, match=r"power is -?9.* W at .*, as loggers write where a reading is missing"):
        checked(dtype(code), told)


@given(st.sampled_from(CODES.tolist()), st.floats(0.1, 4.9))
def test_a_reading_that_is_common_is_no_code(code, away):
    told = encoding(code + away * 50.0, 50.0)
    assert checked(code, told)[0, 1, 0] == np.float32(code)


def test_a_rare_reading_is_no_code():
    assert checked(9990.0, encoding(700.0, 900.0))[0, 1, 0] == 9990.0


def test_a_missing_reading_is_left_missing():
    assert np.isnan(checked(np.nan, encoding(700.0, 900.0))[0, 1, 0])


@pytest.mark.parametrize(
    ("holes", "largest", "sentence"),
    [
        ({0: 2, 1: 3}, 0.2, "power of system 8 has 3 missing values in its last 10 samples; expected at most 2: fill"),
        ({0: 2, 1: 2}, 0.2, None),
        ({0: 1, 1: 1}, 0.0, "power of system 4 has 1 missing value in its last 10 samples; expected none: fill"),
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


def test_infinite_readings_are_told_apart_from_missing_ones():
    values = np.ones((1, 10))
    values[0, :5] = np.nan
    values[0, 5] = -np.inf
    sentence = r"r\.nc: power has 1 infinite value in its last 10 samples; expected numbers: check the unit"
    with pytest.raises(RecordingError, match=sentence):
        check_gaps(Path("r.nc"), "power", values, [None], 0.9)
