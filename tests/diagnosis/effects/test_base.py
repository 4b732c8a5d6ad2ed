"""Readings that a clock would have to invent count for no candidate."""

import numpy as np
import pytest

from diagnosis.effects import build, library
from diagnosis.effects.base import foreseen
from diagnosis.recording import DAY, HOUR, Recording
from shared.effects import SensorEffect

STEP, NOISE = 1800.0, 0.1


def clock(system, lower=-3.0, upper=3.0, **more):
    common = {"name": "clock", "kind": "sensor", "unit": "h", "scale": 0.5, "operation": "shift", "factor": HOUR}
    return build(SensorEffect(outputs=["TRoo", "CO2"], lower=lower, upper=upper, **common, **more), system)


def heated(time):
    """A room that is heated from six to ten at night, by straight lines [degC]."""
    return np.interp(time / HOUR % 24, [0, 6, 7, 22, 24], [17.5, 17.0, 21.0, 21.0, 17.5])


def recording(begin, end):
    time = np.arange(begin + STEP, end + 1, STEP)
    return Recording("room.nc", STEP, time, np.tile(heated(time), (4, 1)), {})


@pytest.mark.parametrize("amplitude", [-1.0, 0.25, 1.0])
def test_what_counts_is_what_a_clock_shows_of_a_longer_recording(default_system, amplitude):
    """Ends in the middle of what heats up, at half past six."""
    effect = clock(default_system)
    cut = recording(6.5 * HOUR, 7 * DAY + 6.5 * HOUR)
    time = np.arange(0.0, 8 * DAY, STEP)
    shown = np.interp(cut.time, time, effect.outputs(amplitude, np.tile(heated(time), (4, 1)), time)[0])
    fitted = effect.outputs(amplitude, cut.outputs, cut.time)[0]
    lost = 0.5 * ((shown - fitted) / NOISE) ** 2
    counts = foreseen([effect], cut)
    assert lost[counts[0]].sum() < 1e-9
    assert lost.sum() > 5
    # three hours at either edge, of the outputs that the clock stamps
    assert (~counts).sum(axis=1).tolist() == [12, 12, 0, 0]


def test_every_candidate_is_weighed_by_the_same_readings(default_system):
    week = recording(0.0, 7 * DAY)
    others = [one for one in library(default_system) if one.spec.kind != "sensor" and "shift" not in one.name]
    assert foreseen(others, week).all()
    np.testing.assert_array_equal(
        foreseen([*others, clock(default_system)], week), foreseen([clock(default_system)], week)
    )


def test_a_clock_that_may_invent_more_than_a_quarter_is_not_tried(default_system):
    day = recording(0.0, DAY)
    assert clock(default_system).obstacle(day, replay=False) == ""
    assert "more than a quarter of the readings" in clock(default_system, -4.0, 4.0).obstacle(day, replay=False)
