"""A reading of an output that was lost is none: no line over it passes for one."""

import numpy as np
import pytest
import xarray as xr

from diagnosis.measurements.grid import as_read
from diagnosis.measurements.signal import Signal
from shared.flags import FLAGS
from tests.diagnosis.measurements.house_cases import HOURLY, measured, warmth


def variables(report):
    return {one.name: one for one in report.variables}


def instants(times, max_gap):
    return Signal(times, times, 0.01 * times, np.zeros(len(times), dtype=np.int8), "point", max_gap, "1")


def test_no_more_readings_come_out_than_went_in(house, tmp_path):
    frame, hours = measured(minutes=30)
    lost = np.arange(len(frame)) % 4 == 3
    report = house(frame.assign(room=frame["room"].where(~lost)))
    with xr.open_dataset(tmp_path / "out" / "house.nc") as found:
        warm, flags = found["warmth"].values, found["warmth_flag"].values
    there = np.isfinite(warm)
    # a step ends at each row, of which every fourth lost its reading
    np.testing.assert_array_equal(there, ~lost)
    np.testing.assert_allclose(warm[there], warmth(hours)[there] + 273.15, atol=1e-5)
    np.testing.assert_array_equal(flags == FLAGS["missing"], ~there)
    assert variables(report)["warmth"].missing == lost.sum()


def test_a_mean_over_a_lost_reading_is_partly_covered(house):
    """Ten-minute instants to hourly means: one lost of six leaves lines over two thirds of the hour."""
    frame, hours = measured()
    joined = HOURLY.replace('unit = "kW"\nreading = "mean"', 'unit = "kW"\nreading = "point"')
    gone = np.isclose(hours % 24, 10.5)
    about = variables(house(frame.assign(kilowatts=frame["kilowatts"].where(~gone)), joined))["gas"]
    assert (about.partly, about.missing) == (gone.sum(), 0)
    assert variables(house(frame, joined, out="whole.nc"))["gas"].partly == 0


@pytest.mark.parametrize(("apart", "late"), [(900.0, 420.0), (60.0, 0.0), (1800.0, 0.0)])
@pytest.mark.parametrize("method", ["point", "mean"])
def test_other_cadences_than_the_steps_lose_nothing(apart, late, method):
    """A logger that is late, faster or slower than steps of 900 s, or now and then by a fifth of its spacing."""
    edges = 900.0 * np.arange(97)
    regular = np.arange(-2 * apart, edges[-1] + 2 * apart, apart) + late
    jittered = regular + 0.2 * apart * np.random.default_rng(1).uniform(-1, 1, len(regular))
    for times in (regular, jittered):
        values, flags = as_read(instants(times, 2.5 * apart), edges, method, 0.5, bridges=False)
        expected = 0.01 * (edges[1:] if method == "point" else edges[1:] - 450.0)
        np.testing.assert_allclose(values, expected, atol=1e-9)
        assert not flags.any()
