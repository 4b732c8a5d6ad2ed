"""Readings of outputs that are fewer than the steps of the grid."""

import pytest

from shared.errors import RecordingError
from tests.diagnosis.importing.house_cases import HOURLY, MAPPING, measured


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


def test_gaps_do_not_make_readings_few(house):
    """Of what is lost there are no readings to take for others."""
    frame, hours = measured()
    report = house(frame.assign(room=frame["room"].where(hours % 6 < 1.1)))
    assert variables(report)["warmth"].missing > 200
