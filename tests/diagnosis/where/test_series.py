"""Hour, day and weekend of a step, by the calendar."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.where.finding import all_windows
from diagnosis.where.series import band_names, combine, max_test, split, studentise
from tests.diagnosis.where.where_cases import HOUR, twins


def test_a_step_lies_where_its_middle_does_and_time_zero_is_a_monday():
    days = twins(outputs=1, steps=8 * 24, twins=19)
    np.testing.assert_allclose(days.hour[[0, 1, 23, 24]], [0.5, 1.5, 23.5, 0.5])
    assert days.day[[0, 23, 24, -1]].tolist() == [0, 0, 1, 7]
    # five days of 24 steps, then Saturday and Sunday
    assert np.flatnonzero(days.weekend).tolist() == list(range(120, 168))
    quarters = twins(outputs=1, steps=8, twins=19, step=HOUR / 4)
    np.testing.assert_allclose(quarters.hour[[0, 7]], [0.125, 1.875])


def test_every_row_is_held_against_all_the_others():
    rows = np.random.default_rng(0).gamma(2.0, size=(12, 3))
    expected = np.empty_like(rows)
    for i in range(12):
        others = np.delete(rows, i, axis=0)
        expected[i] = (rows[i] - others.mean(axis=0)) / others.std(axis=0, ddof=1)
    np.testing.assert_allclose(studentise(rows), expected, rtol=1e-10)


def test_cells_that_are_constant_or_missing_take_no_part():
    rows = np.random.default_rng(0).normal(size=(40, 4))
    rows[:, 1] = 2.0
    rows[7, 2] = np.nan
    test = max_test(rows)
    assert test.kept.tolist() == [True, False, False, True]
    assert test.adjusted[[1, 2]].tolist() == [1.0, 1.0]
    assert test.p_value == max_test(rows[:, [0, 3]]).p_value


def test_a_cell_in_which_all_twins_agree_and_the_recording_does_not_is_significant():
    rows = np.random.default_rng(0).normal(size=(40, 2))
    rows[:, 1] = 0.0
    rows[0, 1] = 1.0
    test = max_test(rows)
    assert test.adjusted[1] == pytest.approx(1 / 40)
    assert np.isfinite(test.t[1])


@given(
    seed=st.integers(0, 10_000),
    shift=st.floats(-1e3, 1e3),
    scale=st.floats(1e-3, 1e3),
    order=st.permutations(range(5)),
)
def test_units_and_order_of_cells_do_not_matter(seed, shift, scale, order):
    rows = np.random.default_rng(seed).normal(size=(30, 5))
    plain, other = max_test(rows), max_test((rows * scale + shift)[:, order])
    np.testing.assert_allclose(other.adjusted, plain.adjusted[order])
    np.testing.assert_allclose(other.t, plain.t[order], rtol=1e-5, atol=1e-6)
    assert other.p_value == plain.p_value == plain.adjusted.min()


def test_p_values_of_dependent_skewed_cells_are_uniform():
    """1500 families of 20 cells that share most of their variance, exponentiated: 5 % are significant at 0.05."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(1500):
        rows = np.exp(rng.normal(size=(40, 1)) + rng.normal(size=(40, 20)))
        found.append(max_test(rows).p_value)
    share = np.mean(np.array(found) <= 0.05)
    assert abs(share - 0.05) < 3 * np.sqrt(0.05 * 0.95 / 1500)
    assert np.mean(found) == pytest.approx(0.5 + 0.5 / 40, abs=3 * np.sqrt(1 / 12 / 1500))


def test_families_are_combined_into_one_level():
    rng = np.random.default_rng(4)
    found = [combine([max_test(rng.normal(size=(40, k))) for k in (3, 30)]).p_value for _ in range(1000)]
    assert abs(np.mean(np.array(found) <= 0.05) - 0.05) < 3 * np.sqrt(0.05 * 0.95 / 1000)


def test_a_family_that_stands_out_carries_the_whole():
    rng = np.random.default_rng(5)
    families = [rng.normal(size=(100, k)) for k in (3, 30)]
    families[0][0, 1] = 30.0
    whole = combine([max_test(rows) for rows in families])
    assert whole.p_value == pytest.approx(0.01)
    assert whole.adjusted[0] == pytest.approx(0.01)
    assert whole.adjusted[1] > 0.05


def test_cells_of_which_only_large_values_count():
    """Against the same test of cells whose small values have been cut off: nothing below the mean counts."""
    rows = np.random.default_rng(7).normal(size=(200, 3))
    rows[0] = [-9.0, 0.0, 0.1]
    both, mixed = max_test(rows), max_test(rows, upper=np.array([True, False, True]))
    assert both.p_value == both.adjusted[0] == pytest.approx(1 / 200)
    assert mixed.adjusted[0] == 1.0
    assert mixed.p_value > 0.5
    t = studentise(rows)
    np.testing.assert_allclose(mixed.maxima, np.maximum(t.max(axis=1), -t[:, 1]))
    _, again = mixed.restudentise(np.array([-9.0, -9.0, 9.0]))
    assert again == pytest.approx([1.0, 1 / 200, 1 / 200])


@given(seed=st.integers(0, 1000), missing=st.floats(0, 0.5))
def test_bands_add_up_to_the_whole_and_keep_its_gaps(seed, missing):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(2, 300)).cumsum(axis=1)
    values[rng.random(values.shape) < missing] = np.nan
    bands = split(values, HOUR)
    total = sum(part for name, part in bands.items() if name != "all")
    np.testing.assert_allclose(total, values, atol=1e-9)
    for part in bands.values():
        assert (np.isnan(part) == np.isnan(values)).all()


@pytest.mark.parametrize(("period", "band"), [(7 * 24, "slow"), (24, "diurnal"), (2, "fast")])
def test_a_sinusoid_lands_in_its_band_with_the_gaussian_gain(period, band):
    """Low-pass gain at period P of an edge E is 2 ** -(E / P) ** 2; a band takes it from what slower ones left."""
    step = 900.0
    time = np.arange(28 * 96) / 4
    wave = np.cos(2 * np.pi * time / period)
    inner = slice(5 * 96, -5 * 96)
    gains = {
        name: (part[inner] @ wave[inner]) / (wave[inner] @ wave[inner]) for name, part in split(wave, step).items()
    }
    left, expected = 1.0, {}
    for name, edge in (("slow", 48), ("diurnal", 9), ("hours", 3)):
        expected[name] = left * 2 ** -((edge / period) ** 2)
        left -= expected[name]
    expected["fast"] = left
    for name, gain in expected.items():
        assert gains[name] == pytest.approx(gain, abs=0.01)
    assert max(expected, key=expected.get) == band


def test_a_record_shows_only_bands_that_it_can_resolve():
    assert band_names(HOUR, 672) == ["all", "slow", "diurnal", "hours", "fast"]
    assert band_names(300.0, 2016) == ["all", "slow", "diurnal", "hours", "fast"]
    assert band_names(HOUR, 72) == ["all", "diurnal", "hours", "fast"]
    assert band_names(6 * HOUR, 112) == ["all", "slow", "diurnal"]


@pytest.mark.parametrize(("hours", "lengths"), [(1, {24, 6, 1}), (4, {24, 4}), (8, {24})])
def test_a_window_holds_as_many_steps_as_any_other_of_its_length(hours, lengths):
    """A block of six hours would hold one of two steps of four hours, or both."""
    hour = (np.arange(0, 24, hours) + 0.5 * hours).repeat(7)  # a week
    residuals = SimpleNamespace(step=3600.0 * hours, time=hour, hour=hour, weekend=np.zeros(len(hour), dtype=bool))
    windows, holds = all_windows(residuals)
    assert {one.stop - one.start for one in windows} == lengths
    for length in lengths:
        of = [k for k, one in enumerate(windows) if one.stop - one.start == length and one.day_type == "any"]
        assert len(set(holds[of].sum(1))) == 1 and holds[of].sum() == len(hour)
