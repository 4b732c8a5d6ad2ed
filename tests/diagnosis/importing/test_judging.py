"""Readings of outputs that are fewer than the steps of the grid."""

import numpy as np
import pytest
import xarray as xr

from shared.errors import RecordingError
from tests.diagnosis.importing.house_cases import HOURLY, HOUSE, MAPPING, measured


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


def test_a_heat_flux_goes_either_way(house, tmp_path):
    """Of what is in W/m2 only irradiance is never negative: here the loss through a wall, and what radiates upwards."""
    (tmp_path / "other.toml").write_text(
        HOUSE.replace('name = "gas", unit = "W"', 'name = "gas", unit = "W/m2"').replace(
            'name = "air", unit = "kg/s"', 'name = "air", unit = "W/m2"'
        )
    )
    frame, hours = measured(minutes=30)
    flux = 5.0 * np.sin(2 * np.pi * hours / 24) - 1.0
    mapping = MAPPING.replace('"kW"', '"W/m2"').replace('unit = "m3/h"\nscale = 2.4', 'unit = "W/m2"')
    house(frame.assign(kilowatts=flux, valve=40.0 * flux), mapping, system=tmp_path / "other.toml")
    with xr.open_dataset(tmp_path / "out" / "house.nc") as found:
        np.testing.assert_allclose(found["gas"], flux[-found.sizes["time"] :], atol=1e-5)
        np.testing.assert_allclose(found["air"], 40.0 * flux[-found.sizes["time"] :], atol=1e-4)
