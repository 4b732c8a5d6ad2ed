"""Noise around a small flow leaves its mean as it is; what is far below zero is no noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.grid import resample
from diagnosis.measurements.mapping import Source
from diagnosis.measurements.signal import make_signal, mark_impossible
from shared.schema import IMPOSSIBLE

SEEDS = st.integers(0, 10**6)


def judged(readings, unit="kg/s", **more):
    source = Source(column="flow", unit=unit, **more)
    time = 600.0 * np.arange(1, len(readings) + 1)
    signal = make_signal(time, readings, source, unit, kind="mean", stamp="end", density=1.2, where="x")
    return mark_impossible(signal, source, density=1.2, where="x")


@settings(max_examples=40)
@given(seed=SEEDS, flow=st.floats(0, 0.03), noise=st.floats(0.002, 0.02), step=st.sampled_from([0.0, 0.002]))
def test_the_mean_of_a_noisy_meter_is_that_of_the_flow(seed, flow, noise, step):
    """Within what noise alone makes it: its standard deviation over the root of how many readings there are."""
    readings = np.random.default_rng(seed).normal(flow, noise, 1008)
    readings = np.round(readings / step) * step if step else readings
    means, _ = resample(judged(readings), np.arange(0.0, 1008 * 600.0 + 1, 3600.0), "mean", 0.5)
    assert means.mean() == pytest.approx(flow, abs=4.5 * noise / np.sqrt(1008) + 1e-4)
    assert np.isfinite(means).all()


@settings(max_examples=40)
@given(seed=SEEDS, noise=st.floats(0.001, 0.01), swing=st.floats(0.0, 0.1), fault=st.floats(0.15, 5.0))
def test_what_is_far_below_zero_stays_impossible(seed, noise, swing, fault):
    """A ventilation by day, whose meter also reads noise by night, and a fault or a wrong sign now and then."""
    rng = np.random.default_rng(seed)
    time = np.arange(1008)
    on = (time % 144 > 54) & (time % 144 < 108)
    readings = on * (0.2 + swing * rng.uniform(-1, 1, len(time))) + rng.normal(0, noise, len(time))
    wrong = np.zeros(len(time), dtype=bool)
    wrong[rng.choice(len(time), 15, replace=False)] = True
    signal = judged(np.where(wrong, -fault, readings))
    np.testing.assert_array_equal(signal.flags == IMPOSSIBLE, wrong)


@pytest.mark.parametrize("code", [-9999.0, 9999.0, -99.9])
def test_codes_of_a_heat_meter_are_left_out(code):
    """A power has no highest or lowest possible value that would tell."""
    time = 3600.0 * np.arange(8)
    readings = np.array([0.0, 120.0, code, 340.0, 410.0, 90.0, 15.0, 60.0])
    signal = make_signal(
        time, readings, Source(column="heat", unit="W"), "W", kind="mean", stamp="end", density=1.2, where="x"
    )
    np.testing.assert_array_equal(signal.flags, np.where(readings == code, IMPOSSIBLE, 0))
    assert signal.clean().values.min() == 0.0 and signal.clean().values.max() == 410.0
    told = Source(column="heat", unit="W", valid=(-1e5, 1e5))
    assert not make_signal(time, readings, told, "W", kind="mean", stamp="end", density=1.2, where="x").flags.any()
