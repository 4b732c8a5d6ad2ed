import numpy as np
import pytest

from diagnosis.measurements.mapping import Source
from diagnosis.measurements.signal import make_signal
from shared.flags import IMPOSSIBLE


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
