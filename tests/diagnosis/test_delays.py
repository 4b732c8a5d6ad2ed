"""Clocks that are hours off, found in a hall whose natural delays are known; and none found in one that is right."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.delays import find_delays
from tests.diagnosis.hall_cases import hall, lived

HALL = hall()


def late(recording, hours, *names):
    """The recording with stamps of some columns moved to later times; readings before the first are lost."""
    steps = round(hours * 3600 / recording.step)
    outputs, inputs = recording.outputs.copy(), dict(recording.inputs)
    for name in names:
        if name in inputs:
            inputs[name] = np.roll(inputs[name], steps)
            continue
        row = HALL.output_names.index(name)
        outputs[row] = np.roll(outputs[row], steps)
        outputs[row, slice(None, steps) if steps > 0 else slice(steps, None)] = np.nan
    return replace(recording, outputs=outputs, inputs=inputs)


@pytest.mark.parametrize("days", [7, 14])
def test_a_natural_delay_is_no_clock(days):
    """Memories of 28 h and of nearly one; weeks that begin on any weekday."""
    for seed in range(8):
        assert find_delays(HALL, lived(days, seed=seed, begin=seed)) == []


@pytest.mark.parametrize("hours", [-8.0, 5.0])
def test_outputs_that_share_a_clock_are_named_together(hours):
    (found,) = find_delays(HALL, late(lived(), hours, "warmth", "breathed"))
    assert found.names == ("warmth", "breathed") and found.hours == pytest.approx(hours, abs=1.0)
    assert set(found.causes) == {"outside", "shine", "heads"}


def test_one_output_alone_and_two_clocks():
    (found,) = find_delays(HALL, late(lived(), 6.0, "warmth"))
    assert found.names == ("warmth",) and found.hours == pytest.approx(6.0, abs=1.0)
    both = late(late(lived(), -8.0, "warmth"), 4.0, "breathed")
    shifts = {found.names: found.hours for found in find_delays(HALL, both)}
    assert shifts == {("warmth",): pytest.approx(-8.0, abs=1.0), ("breathed",): pytest.approx(4.0, abs=1.0)}


def test_persons_that_are_late_are_told_from_a_gas_that_is_early_or_named_as_its_rival():
    (found,) = find_delays(HALL, late(lived(), 5.0, "heads"))
    named = {found.names: found.hours} | dict.fromkeys(found.rivals, -found.hours)
    assert named[("heads",)] == pytest.approx(5.0, abs=1.0)


def test_nothing_is_said_of_what_is_too_short_too_coarse_or_not_measured():
    shifted = late(lived(), -8.0, "warmth", "breathed")
    names = dict.fromkeys(shifted.inputs, "assumed")
    assert find_delays(HALL, replace(shifted, assumed=names)) == []
    short = 72
    cut = replace(
        shifted,
        time=shifted.time[:short],
        outputs=shifted.outputs[:, :short],
        inputs={name: one[:short] for name, one in shifted.inputs.items()},
    )
    assert find_delays(HALL, cut) == []
    assert find_delays(HALL, late(lived(step=7200.0), -8.0, "warmth", "breathed")) == []


def test_a_long_recording_with_holes_is_searched_in_pieces():
    """Months without a reading, readings that are never two in a row, and steps that divide no day."""
    recording = late(lived(days=100), -8.0, "warmth", "breathed")
    holes = recording.outputs.copy()
    holes[0, : 40 * 24] = np.nan
    holes[1, ::2] = np.nan
    (found,) = find_delays(HALL, replace(recording, outputs=holes))
    assert found.names == ("warmth",) and found.hours == pytest.approx(-8.0, abs=1.0)
    assert find_delays(HALL, replace(recording, outputs=np.full_like(holes, np.nan))) == []
    odd = lived(step=1000.0)
    assert find_delays(HALL, odd) == []
    (found,) = find_delays(HALL, late(odd, -8.0, "warmth", "breathed"))
    assert found.hours == pytest.approx(-8.0, abs=1.0)
