"""Random occupancy: plausible days, and draws that depend on the system and the day alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from datagen.driving.occupancy import occupancy_prior, sample_occupancy
from datagen.driving.sampling import stream
from datagen.driving.tables import merge
from shared.signals import Occupancy

HOUR, DAY = 3600.0, 86400.0
SPEC = Occupancy(
    headcount=(4, 16), arrival=(7.0, 9.5), duration=(7.0, 10.0), jitter=0.5, attendance=(0.4, 1.0), gaps=(1, 3),
    gap_duration=(0.4, 1.5), gap_share=(0.3, 1.0), absence=0.05, weekend=0.15,
)  # fmt: skip

PLAIN = SPEC.model_copy(
    update={"jitter": 0.0, "gaps": (0, 0), "absence": 0.0, "weekend": 1.0, "attendance": (1.0, 1.0)}
)


def year(index, start=0.0, stop=365 * DAY, spec=SPEC):
    return sample_occupancy(spec, stream(7, index, "occupancy"), start, stop)


@given(st.integers(0, 10**6))
@settings(max_examples=15)
def test_persons_are_whole_numbers_and_nights_are_empty(index):
    signal = year(index)
    assert signal.kind == "previous"
    assert signal.times[0] == 0
    assert (signal.values == np.round(signal.values)).all()
    assert signal.values.min() >= 0
    assert signal.values.max() <= 16
    assert (np.diff(signal.values) != 0).all()
    # earliest start 7 - 3 * 0.5 h, latest end 9.5 + 10 + 3 * 0.5 h
    nights = np.concatenate([np.arange(365) * DAY + h * HOUR for h in (0, 3, 5.4, 21.1, 23.9)])
    assert (signal.at(nights) == 0).all()


def test_an_occupied_day_has_a_few_changes_anywhere_within_the_hour():
    counts, minutes, days_in = [], [], np.zeros(7)
    for index in range(40):
        signal = year(index)
        day = np.floor(signal.times[1:] / DAY).astype(int)
        per_day = np.bincount(day, minlength=365)
        counts.append(per_day[per_day > 0])
        minutes.append(np.mod(signal.times[1:], HOUR) / HOUR)
        np.add.at(days_in, np.flatnonzero(per_day) % 7, 1 / (40 * 365 / 7))
    counts, minutes = np.concatenate(counts), np.concatenate(minutes)
    assert counts.min() >= 4
    assert counts.max() <= 8
    # uniform within the hour: mean 1/2, variance 1/12 (80,000 changes)
    assert abs(minutes.mean() - 0.5) < 0.01
    assert abs(minutes.var() - 1 / 12) < 0.005
    np.testing.assert_allclose(days_in[:5], 0.95, atol=0.02)
    np.testing.assert_allclose(days_in[5:], 0.15, atol=0.03)


@given(st.integers(0, 10**6), st.floats(-30 * DAY, 60 * DAY), st.floats(HOUR, 40 * DAY))
@settings(max_examples=20)
def test_a_day_is_the_same_in_every_span(index, start, length):
    whole = year(index, -40 * DAY, 120 * DAY)
    part = year(index, start, start + length)
    t = np.random.default_rng(0).uniform(start, start + length, 300)
    np.testing.assert_array_equal(part.at(t), whole.at(t))
    inside = (whole.times > start) & (whole.times < start + length)
    np.testing.assert_array_equal(part.times[1:], whole.times[inside])


def test_the_weekend_is_that_of_the_dates():
    """Time zero is a Monday in every file; a description that says otherwise would contradict the dates."""
    signal = year(0, spec=SPEC.model_copy(update={"absence": 0.0, "weekend": 0.0}))
    assert {int(t // DAY) % 7 for t in signal.times[1:]} == {0, 1, 2, 3, 4}
    with pytest.raises(ValidationError, match="is 3; expected 0: time zero is Monday 1 January 2001"):
        Occupancy.model_validate(SPEC.model_dump() | {"first_weekday": 3})


def test_work_past_midnight_reaches_into_the_next_day():
    spec = PLAIN.model_copy(update={"arrival": (20.0, 20.0), "duration": (8.0, 8.0)})
    signal = year(0, 5 * DAY, 7 * DAY, spec)
    assert signal.at(5 * DAY) > 0  # from the evening before
    assert signal.at(5 * DAY + 5 * HOUR) == 0
    np.testing.assert_allclose(np.mod(signal.times[1:], DAY) / HOUR, [4, 20, 4, 20])


def test_prior_has_the_distribution_of_the_samples():
    edges = np.arange(0, 7 * 24 + 1) * HOUR
    prior = occupancy_prior(SPEC, edges, 4000, seed=1)
    assert prior.shape == (4000, 168)
    assert prior.min() >= 0
    drawn = np.array([merge({"n": year(i, 0, 7 * DAY)}, 0, 7 * DAY).means(edges)[:, 0] for i in range(1500)])
    # standard error of a mean of about 4 persons' spread over 1,500 systems: 0.1
    np.testing.assert_allclose(prior.mean(axis=0), drawn.mean(axis=0), atol=0.5)
    np.testing.assert_allclose(prior.std(axis=0), drawn.std(axis=0), atol=0.5)
    # the headcount belongs to the system: Monday's and Tuesday's noon go together
    assert 0.2 < np.corrcoef(prior[:, 12], prior[:, 36])[0, 1] < 0.9
    np.testing.assert_array_equal(prior, occupancy_prior(SPEC, edges, 4000, seed=1))


def test_prior_means_are_exact_for_a_certain_schedule():
    sure = PLAIN.model_copy(update={"headcount": (8, 8), "arrival": (8.25, 8.25), "duration": (9.0, 9.0)})
    prior = occupancy_prior(sure, np.arange(-1, 25) * HOUR, 3, seed=0)
    expected = np.zeros(25)
    expected[9], expected[10:18], expected[18] = 0.75 * 8, 8, 0.25 * 8  # interval j is the hour from j - 1
    np.testing.assert_allclose(prior, np.tile(expected, (3, 1)), atol=1e-12)
    # the window may begin in the middle of the day
    np.testing.assert_allclose(occupancy_prior(sure, [12 * HOUR, 13 * HOUR], 1, seed=0), [[8.0]], atol=1e-12)


def test_what_a_system_draws_once_is_uniform_and_independent():
    """Every headcount of the span, ends included; arrivals say nothing about how long the day is."""
    signals = [year(index, 0.0, 2 * DAY, PLAIN) for index in range(400)]
    heads = [one.values.max() for one in signals]
    assert set(heads) == set(range(4, 17))
    assert np.mean(heads) == pytest.approx(10.0, abs=0.7)  # standard error 0.19
    begin, end = np.array([one.times[1:3] / HOUR for one in signals]).T
    for drawn, (low, high) in ((begin, SPEC.arrival), (end - begin, SPEC.duration)):
        assert low <= drawn.min() < low + 0.05 * (high - low) and high - 0.05 * (high - low) < drawn.max() <= high
        assert drawn.mean() == pytest.approx((low + high) / 2, abs=0.06 * (high - low))  # standard error 0.014
    assert abs(np.corrcoef(begin, end - begin)[0, 1]) < 0.2  # standard error 0.05
