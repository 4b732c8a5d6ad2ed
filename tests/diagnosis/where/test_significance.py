import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.where.series import combine, max_test, studentise


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
