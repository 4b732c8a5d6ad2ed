"""Stretches are all there are, the one that is taken was asked for, and short gaps are bridged by a straight line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.errors import RecordingError
from shared.stretches import Steps, Stretch, bridge, chosen, stretches

HOURS = 24 * 12
STEPS = Steps(
    Path("r.nc"), np.datetime64("2021-03-01T00:00:00") + np.arange(1, HOURS + 1).astype("timedelta64[h]"), 3600.0
)


def known(*gaps):
    there = np.ones(HOURS, dtype=bool)
    for first, after in gaps:
        there[first:after] = False
    return {"sun": there, "wind": np.ones(HOURS, dtype=bool)}


WEEKENDS = known((48, 60), (70, 75), (150, 151))
"""Whole in hours 0 to 48 and 75 to 150 and 151 to 288; those from 60 to 70 are no day."""


def test_stretches_are_at_least_a_day():
    assert stretches(WEEKENDS["sun"], 3600.0) == [(0, 48), (75, 150), (151, 288)]
    assert stretches(np.ones(24, dtype=bool), 3600.0) == [(0, 24)]
    assert stretches(np.ones(95, dtype=bool), 900.0) == []


@pytest.mark.parametrize(
    ("choice", "taken"),
    [
        (None, (151, 288)),
        (Stretch(), (151, 288)),
        (Stretch(1), (0, 48)),
        (Stretch(2), (75, 150)),
        (Stretch(begin="2021-03-04", end="2021-03-06"), (75, 144)),  # a date alone is included
        (Stretch(begin="2021-03-05 06:00", end="2021-03-07 00:00"), (102, 144)),
        (Stretch(end="2021-03-03"), (0, 48)),
        (Stretch(begin="2021-03-10"), (216, 288)),
    ],
)
def test_the_stretch_that_was_asked_for_is_taken(choice, taken):
    assert chosen(STEPS, WEEKENDS, choice) == taken


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        (Stretch(4), r"r\.nc: has no stretch 4; expected one of 1: 2021-03-01 00:00 to 2021-03-03 00:00 \(48 h\); 2: "),
        (Stretch(0), "has no stretch 0"),
        (
            Stretch(1, begin="2021-03-01"),
            "--stretch is given together with --from or --to; expected a number, or dates",
        ),
        (Stretch(begin="March"), "--from is 'March'; expected a date by the recording's clock, such as 2021-03-08"),
        (Stretch(end="2021-13-01"), "--to is '2021-13-01'"),
        (Stretch(begin="2021-03-03", end="2021-03-03"), "less than a day without gaps between the dates of --from and"),
    ],
)
def test_what_cannot_be_taken_is_a_sentence(choice, said):
    with pytest.raises(RecordingError, match=said):
        chosen(STEPS, WEEKENDS, choice)


def test_where_there_is_no_day_it_is_said_what_is_in_the_way():
    persons = np.arange(HOURS) % 20 > 2
    with pytest.raises(
        RecordingError, match=r"17 h \(n in 45 of 288 .*; without n \(--occupancy unknown\) there would"
    ):
        chosen(STEPS, {**known(), "n": persons}, None, {"n": "--occupancy unknown"})


def test_short_inner_gaps_are_bridged_and_no_others():
    nan = np.nan
    values = np.array([nan, 1.0, nan, 3.0, nan, nan, 0.0, nan, nan, nan, 4.0, nan])
    filled = bridge(values, 2)
    np.testing.assert_allclose(values, [nan, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, nan, nan, nan, 4.0, nan])
    assert np.flatnonzero(filled).tolist() == [2, 4, 5]


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.integers(0, 6))
def test_a_straight_line_is_itself_again_wherever_something_is_put_in(missing, longest):
    line = 3.0 - 0.5 * np.arange(len(missing))
    values = np.where(missing, np.nan, line)
    before = np.isnan(values)
    filled = bridge(values, longest)
    np.testing.assert_allclose(values[~np.isnan(values)], line[~np.isnan(values)])
    assert (filled == (before & ~np.isnan(values))).all()
