import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis.where.series import band_names, split
from tests.diagnosis.where.where_cases import HOUR


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
