"""Noise around a small flow leaves its mean as it is; what is far below zero is no noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.measurements.grid import resample
from diagnosis.measurements.mapping import Source
from diagnosis.measurements.signal import make_signal, mark_impossible, reach_of_noise
from shared.flags import IMPOSSIBLE
from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING, measured

SEEDS = st.integers(0, 10**6)


def judged(readings, unit="kg/s", **more):
    source = Source(column="flow", unit=unit, **more)
    time = 600.0 * np.arange(1, len(readings) + 1)
    signal = make_signal(time, readings, source, unit, kind="mean", stamp="end", density=1.2, where="x")
    return mark_impossible(signal, source, density=1.2, where="x")


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, flow=st.floats(0, 0.03), noise=st.floats(0.002, 0.02), step=st.sampled_from([0.0, 0.002]))
def test_the_mean_of_a_noisy_meter_is_that_of_the_flow(seed, flow, noise, step):
    """Within what noise alone makes it: its standard deviation over the root of how many readings there are."""
    readings = np.random.default_rng(seed).normal(flow, noise, 1008)
    readings = np.round(readings / step) * step if step else readings
    means, _ = resample(judged(readings), np.arange(0.0, 1008 * 600.0 + 1, 3600.0), "mean", 0.5)
    assert means.mean() == pytest.approx(flow, abs=4.5 * noise / np.sqrt(1008) + 1e-4)
    assert np.isfinite(means).all()


@settings(max_examples=40, deadline=None)
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


@pytest.mark.parametrize(("upper", "reach"), [(1.0, 6.147), (9.0, 7.413)])
def test_the_reach_of_noise_by_hand(upper, reach):
    """Readings that change between -1 and 1 differ by 2, between -1 and 9 by 10, and half of them are 1 below zero.

    Differences of a normal variable have an upper quartile of 1.1503 sqrt(2) standard deviations, and its size a median
    of 0.6745: five of them are 5 * 2 / 1.6268 = 6.147 or 5 * 10 / 1.6268 = 30.7, and 5 / 0.6745 = 7.413; the least of
    these is the reach.
    """
    assert reach_of_noise(np.append(np.tile([-1.0, upper], 50), 100.0)) == pytest.approx(reach, abs=1e-3)


@pytest.mark.parametrize("count", [1, 5, 20, 100])
def test_a_wrong_sign_is_no_noise(count):
    rng = np.random.default_rng(count)
    flow = 0.2 + 0.05 * np.sin(np.arange(1000) / 20) + rng.normal(0, 0.003, 1000)
    wrong = rng.choice(1000, count, replace=False)
    flow[wrong] *= -1
    assert reach_of_noise(flow) == 0.0
    assert (np.flatnonzero(judged(flow).flags) == np.sort(wrong)).all()


def test_offsets_and_rounding_are_zero_as_before():
    """A pyranometer at night, an anemometer in a calm: all errors are to one side."""
    sun = np.maximum(500 * np.sin(2 * np.pi * np.arange(288) / 144), -2.0)
    assert judged(sun, "W/m2").values.min() == 0.0
    wind = np.maximum(3 * np.sin(2 * np.pi * np.arange(288) / 144), -0.05)
    assert judged(wind, "m/s").values.min() == 0.0
    nothing = judged(np.where(np.arange(288) % 7 == 0, -0.002, 0.1), valid=(0.0, 1.0))
    assert (nothing.flags == IMPOSSIBLE).sum() == 42  # the mapping knows better


def test_an_input_is_not_below_zero_but_its_readings_are(house):
    """Six readings a step, of which noise takes a third below zero: their mean is not raised by it."""
    frame, hours = measured(minutes=5)
    rng = np.random.default_rng(0)
    frame["valve"] = np.where(hours % 24 > 12, 0.02, 0.005) + rng.normal(0, 0.01, len(hours))
    mapping = MAPPING.replace('unit = "m3/h"\nscale = 2.4', 'unit = "kg/s"').replace("fill = 0.0\n", "")
    report = house(frame, mapping)
    (air,) = [one for one in report.variables if one.name == "air"]
    assert air.impossible == 0 and air.minimum == 0.0
    assert air.mean == pytest.approx(0.0125, abs=0.0006)
    assert any("column valve" in one and "are taken for the meter's noise" in one for one in report.notes)
    (said,) = [one for one in report.notes if one.startswith("air: ")]
    before, after = (float(one.split(" ")[0]) for one in (said.split("and was ")[1], said.split("of all is ")[1]))
    assert before == pytest.approx(0.0125, abs=0.0005) and before <= after


def test_an_excitation_goes_either_way(house, tmp_path):
    """It is added to an air flow, which itself is never negative."""
    excited = '{ name = "shake", unit = "kg/s", source = "excitation", excitation = "shake" },\n  { name = "people"'
    shaken = "[excitations.shake]\ncomponents = [{ amplitude = 0.005, period = 5.9 }]\n"
    (tmp_path / "shaken.toml").write_text(HOUSE.replace('{ name = "people"', excited) + shaken)
    frame, hours = measured()
    frame["extra"] = 0.05 * np.sin(hours)
    report = house(
        frame, MAPPING + '[variables.shake]\ncolumn = "extra"\nunit = "kg/s"\n', system=tmp_path / "shaken.toml"
    )
    (shake,) = [one for one in report.variables if one.name == "shake"]
    assert shake.impossible == 0
    assert (shake.minimum, shake.maximum) == pytest.approx((-0.05, 0.05), abs=1e-3)
