"""Readings of outputs that are fewer than the steps of the grid."""

import numpy as np
import pytest

from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import HOURLY, HOUSE, MAPPING, measured


def variables(report):
    return {one.name: one for one in report.variables}


@pytest.mark.parametrize(
    ("few", "found"),
    [("room", r"warmth: column 'room': its readings are 3600 s"), ("kilowatts", r"gas: .*are means over 3600 s")],
)
def test_one_reading_is_not_taken_for_several(house, tmp_path, few, found):
    """Instants joined by lines and means cut into parts count as often as there are steps, as if each had been read."""
    frame, hours = measured()
    seldom = frame.assign(**{few: frame[few].where(hours % 1 == 0)})
    with pytest.raises(RecordingError, match=rf"variables.{found}.*a step is 1800 s.*expected .*grid.step = 3600 "):
        house(seldom)
    assert not (tmp_path / "out").exists()
    assert house(seldom, HOURLY).steps == 144


def test_inputs_and_states_may_be_read_less_often_than_steps(house):
    frame, hours = measured()
    seldom = frame.assign(outside=frame["outside"].where(hours % 1 == 0))
    assert house(seldom, out="weather.nc").steps == 288
    held = MAPPING.replace('unit = "degC"\ncompare', 'unit = "degC"\nreading = "hold"\ncompare', 1)
    assert house(frame.assign(room=frame["room"].where(hours % 1 == 0)), held, out="held.nc").steps == 288


@pytest.mark.parametrize("unit", ["W/m2", "W.m-2"])
def test_the_same_irradiance_is_left_out_in_every_spelling(house, tmp_path, unit):
    (tmp_path / "sun.toml").write_text(HOUSE.replace('"sunshine", unit = "W/m2"', f'"sunshine", unit = "{unit}"'))
    frame, hours = measured()
    frame["sun"] = np.where((hours >= 50) & (hours < 52), 5000.0, frame["sun"])
    mapping = MAPPING.replace("[weather.ghi]", "[variables.sunshine]")
    report = house(frame, mapping, system=tmp_path / "sun.toml")
    wrong = int((frame["sun"] == 5000.0).sum())
    (note,) = [one for one in report.notes if one.startswith("column sun") and "left out" in one]
    assert note.startswith(f"column sun: {wrong} of {len(frame)} readings are left out: not -20 to 1500 W/m2")
