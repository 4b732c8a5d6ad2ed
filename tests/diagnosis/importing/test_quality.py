import numpy as np
import pytest

from diagnosis.importing.mapping import Meter, Source
from diagnosis.importing.quality import make_signal, mark_stuck
from shared.flags import IMPOSSIBLE, STUCK
from shared.still import DARK, Resting


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


@pytest.mark.parametrize(("night", "left_out"), [(0.0, False), (1.0, False), (-2.0, False), (300.0, True)])
def test_a_pyranometer_may_stand_still_in_the_dark(night, left_out):
    """With a small offset, too; a level that only the sun makes may not."""
    time = 3600.0 * np.arange(48)
    sun = np.maximum(500.0 * np.sin(2 * np.pi * (np.arange(48) - 8) / 24), 0.0)
    readings = np.where(sun > 0, sun, night)
    source = Source(column="sun", unit="W/m2")
    signal = make_signal(time, readings, source, "W/m2", kind="point", stamp="end", density=1.2, where="x")
    marked = mark_stuck(signal, 8.0, Resting(DARK, np.inf))
    assert (marked.flags == STUCK).any() == left_out


def test_a_second_counter_of_presences_says_how_many_persons_one_stands_for():
    assert Meter(column="pir", unit="presence", persons=2.0).persons == 2.0
    with pytest.raises(ValueError, match="expected both or neither"):
        Meter(column="pir", unit="presence")
    with pytest.raises(ValueError, match="expected both or neither"):
        Meter(column="pir", unit="1", persons=2.0)
    with pytest.raises(ValueError, match="scale is 0"):
        Meter(column="pir", unit="1", scale=0.0)
