"""How long a state holds, against states of which every minute is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.signal import DAY, usual_hold
from tests.diagnosis.measurements.house_cases import MAPPING, measured

MINUTE, DAYS = 60.0, 8
SEEDS = st.integers(0, 10**6)


def persons(seed):
    """How many are in the room each minute of eight days: (times [s], numbers)."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, DAYS * DAY, MINUTE)
    number = np.zeros(len(time))
    for day in range(DAYS):
        for _ in range(rng.integers(1, 5)):
            come, go = day * 24 + rng.normal(9, 0.7), day * 24 + rng.normal(17, 0.7)
            lunch = day * 24 + 12 + rng.uniform(0, 1)
            hour = time / 3600
            number += (hour > come) & (hour < go) & ~((hour > lunch) & (hour < lunch + 0.6))
    return time, number


@settings(max_examples=40)
@given(seed=SEEDS, minutes=st.sampled_from([5, 10, 15, 30]), jitter=st.floats(0, 0.45), blank=st.floats(0, 0.6))
def test_what_is_read_all_the_time_does_not_hold_over_an_outage(seed, minutes, jitter, blank):
    """Whatever stamps are late by, and however many cells are blank."""
    time, number = persons(seed)
    rng = np.random.default_rng(seed + 1)
    at = np.arange(MINUTE * minutes, DAYS * DAY - 2 * MINUTE * minutes, MINUTE * minutes)
    at = at + jitter * MINUTE * minutes * rng.uniform(-1, 1, len(at))
    readings = number[np.searchsorted(time, at, side="right") - 1]
    readings[(rng.uniform(size=len(at)) < blank) | ((at > 3.4 * DAY) & (at < 4.1 * DAY))] = np.nan
    usual = float(np.median(np.diff(at[np.isfinite(readings)])))
    assert 1.5 * usual <= usual_hold(at, readings) <= 10 * usual


@settings(max_examples=40)
@given(seed=SEEDS, table=st.sampled_from([None, 5, 10]), starts=st.integers(0, 2), beside=st.booleans())
def test_what_is_logged_when_it_changes_holds_until_it_does(seed, table, starts, beside):
    """In rows of its own, in a regular table, or among the rows of others; and written anew when the logger starts."""
    time, number = persons(seed)
    if table:
        time, number = time[::table], number[::table]
    written = np.concatenate([[True], np.diff(number) != 0])
    written[np.random.default_rng(seed).integers(0, len(time), starts)] = True
    keep = written if not (table or beside) else written | (time % 600 == 0)
    readings = np.where(written, number, np.nan)[keep]
    assert usual_hold(time[keep], readings) == DAY


@pytest.mark.parametrize(("jitter", "blank"), [(0.0, 0.0), (1.0, 0.3)])
def test_a_dropout_of_a_state_that_is_always_read_is_a_gap(house, jitter, blank):
    """Persons of a day are not those of the night after, because the counter fell silent."""
    frame, hours = measured(jitter=jitter)
    lost = (hours > 60) & (hours < 80)
    lost |= np.random.default_rng(1).uniform(size=len(hours)) < blank
    mapping = MAPPING.replace('persons = 2.0\nreading = "mean"', 'persons = 2.0\nreading = "hold"\nfill = 0.0')
    frame["presence"] = frame["presence"].where(~lost).astype("Int64").astype("string").fillna("")
    report = house(frame, mapping)
    (people,) = [one for one in report.variables if one.name == "people"]
    assert people.assumed >= 36
    # present from 9 to 17 but for the five hours of the third day that nobody saw
    assert people.mean == pytest.approx(2 * (6 * 8 - 5) / 144, rel=0.12)
    assert any("column presence: taken for read all the time" in one for one in report.notes)
