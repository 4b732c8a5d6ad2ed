"""Means stay means and instants instants, whatever the readings' times; gaps stay gaps; how long a state holds."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.grid import (
    instants_of,
    means_of,
    resample,
)
from diagnosis.measurements.mapping import Source
from diagnosis.measurements.signal import DAY, Signal, make_signal, usual_hold
from shared.schema import IMPOSSIBLE, PARTLY
from tests.diagnosis.measurements.house_cases import MAPPING, measured

FINITE = st.floats(-1e3, 1e3)


def bins(edges, values, flags=None):
    flags = np.zeros(len(values), dtype=np.int8) if flags is None else flags
    return Signal(edges[:-1], edges[1:], np.array(values, float), flags, "mean", 1e9, "1")


def points(times, values, max_gap=1e9):
    times = np.array(times, float)
    return Signal(times, times, np.array(values, float), np.zeros(len(times), dtype=np.int8), "point", max_gap, "1")


@st.composite
def irregular(draw):
    """Irregular times that cover [0, 1000] s, and values."""
    inner = draw(st.lists(st.integers(1, 999), unique=True, min_size=1, max_size=40))
    times = np.array([0, *sorted(inner), 1000], dtype=float)
    values = draw(st.lists(FINITE, min_size=len(times), max_size=len(times)))
    return times, np.array(values)


@settings(max_examples=25)
@given(irregular(), st.sampled_from([10.0, 40.0, 125.0, 500.0, 1000.0]))
def test_means_conserve_the_total_of_intervals(readings, step):
    times, values = readings
    means, share = means_of(bins(times, values[1:]), np.arange(0.0, 1000.0 + step, step))
    np.testing.assert_allclose(share, 1.0)
    assert means.sum() * step == pytest.approx(float(np.sum(values[1:] * np.diff(times))), abs=1e-6)
    assert means.min() >= values[1:].min() and means.max() <= values[1:].max()


@settings(max_examples=25)
@given(irregular())
def test_a_mean_of_lines_is_the_mean_of_many_points_on_them(readings):
    times, values = readings
    means, _ = means_of(points(times, values), np.linspace(0, 1000, 9))
    fine = np.interp(np.arange(0.5, 1000), times, values).reshape(8, 125).mean(axis=1)
    np.testing.assert_allclose(means, fine, atol=1e-6)  # kinks are at whole seconds: midpoints of these are exact


@given(st.lists(st.sampled_from([0.0, 1.7]), min_size=40, max_size=200))
@settings(max_examples=25)
def test_steps_of_equal_readings_have_exactly_their_value(values):
    """Nobody is zero persons, not 1e-17: what is occupied is asked with a comparison."""
    edges = 900.0 * np.arange(len(values) + 1) + 2.5e7
    means, _ = means_of(bins(edges, values), edges)
    np.testing.assert_array_equal(means, values)


@settings(max_examples=25)
@given(irregular(), st.floats(-5, 5), st.floats(-100, 100))
def test_a_straight_line_keeps_its_instants(readings, slope, level):
    """Of instants and of means alike: a line's mean is its value in the middle of the interval."""
    times, _ = readings
    at = np.linspace(0, 1000, 41)
    np.testing.assert_allclose(instants_of(points(times, level + slope * times), at), level + slope * at, atol=1e-6)
    middle = 0.5 * (times[1:] + times[:-1])
    found = instants_of(bins(times, level + slope * middle), at)
    inside = (at >= middle[0]) & (at <= middle[-1])
    np.testing.assert_allclose(found[inside], (level + slope * at)[inside], atol=1e-6)
    assert np.isnan(found[~inside]).all()


def test_gaps_stay_gaps():
    signal = points([0, 100, 200, 700, 800, 900], [1, 1, 1, 5, 5, 5], max_gap=250.0)
    edges = np.array([0.0, 200.0, 400.0, 600.0, 750.0, 900.0])
    means, share = means_of(signal, edges)
    np.testing.assert_allclose(means[[0, 3, 4]], [1, 5, 5])
    np.testing.assert_allclose(share, [1, 0, 0, 1 / 3, 1])
    assert np.isnan(means[1:3]).all()
    np.testing.assert_allclose(instants_of(signal, np.array([200.0, 450.0, 700.0])), [1, np.nan, 5])
    values, flags = resample(signal, edges, "mean", 0.5)
    assert np.isnan(values[3])
    values, flags = resample(signal, edges, "mean", 0.3)
    assert values[3] == 5 and flags[3] == PARTLY and flags[4] == 0


def test_a_state_holds_until_the_next():
    signal = Signal(
        np.array([0.0, 100.0]), np.array([100.0, 150.0]), np.array([1.0, 3.0]), np.zeros(2, np.int8), "hold", 1e9, "1"
    )
    np.testing.assert_allclose(instants_of(signal, np.array([50.0, 100.0, 140.0, 160.0])), [1, 3, 3, np.nan])
    means, share = means_of(signal, np.array([0.0, 50.0, 150.0, 200.0]))
    np.testing.assert_allclose(means, [1, 2, np.nan])
    np.testing.assert_allclose(share, [1, 1, 0])
    means, share = means_of(signal, np.array([75.0, 175.0]))
    np.testing.assert_allclose([means[0], share[0]], [(25 * 1 + 50 * 3) / 75, 0.75])


@settings(max_examples=25)
@given(irregular(), st.data())
def test_what_is_left_out_has_no_influence(readings, data):
    times, values = readings
    bad = np.array(data.draw(st.lists(st.booleans(), min_size=len(times) - 1, max_size=len(times) - 1)))
    flags = np.where(bad, IMPOSSIBLE, 0).astype(np.int8)
    edges = np.linspace(0, 1000, 11)
    first = resample(bins(times, values[1:], flags), edges, "mean", 0.5)
    second = resample(bins(times, np.where(bad, 1e9, values[1:]), flags), edges, "mean", 0.5)
    np.testing.assert_array_equal(first, second)
    touched = [(bad & (times[:-1] < b) & (times[1:] > a)).any() for a, b in pairwise(edges)]
    np.testing.assert_array_equal((first[1] & IMPOSSIBLE) > 0, touched)


@pytest.mark.parametrize(("interval", "bridged"), [(1800.0, True), (3600.0, False)])
def test_a_line_over_more_than_an_hour_invents_no_reading(interval, bridged):
    times = interval * np.arange(50)
    readings = np.where(np.arange(50) == 20, np.nan, 300.0)
    source = Source(column="x", unit="K")
    signal = make_signal(times, readings, source, "K", kind="point", stamp="end", density=1.2, where="x")
    found = instants_of(signal, times)
    assert np.isfinite(found[np.arange(50) != 20]).all()
    assert np.isfinite(found[20]) == bridged


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
