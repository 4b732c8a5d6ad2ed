"""Readings of outputs that are fewer than the steps of the grid."""

import numpy as np
import pytest
import xarray as xr

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


def test_an_impossible_flow_of_volume_is_left_out_and_said(house, tmp_path):
    (tmp_path / "volume.toml").write_text(HOUSE.replace('name = "air", unit = "kg/s"', 'name = "air", unit = "m3/h"'))
    mapping = MAPPING.replace('unit = "m3/h"\nscale = 2.4', 'unit = "l/s"')
    frame, hours = measured()
    frame["valve"] = np.where((hours >= 50) & (hours < 56), -50.0, 20.0 + np.sin(hours))
    report = house(frame, mapping, system=tmp_path / "volume.toml")
    wrong = int((frame["valve"] == -50.0).sum())
    (note,) = [one for one in report.notes if one.startswith("column valve") and "left out" in one]
    assert note.startswith(f"column valve: {wrong} of {len(frame)} readings are left out: below -0.83")


@pytest.mark.parametrize("unit", ["W/m2", "W/m^2", "W.m-2", "W m-2"])
def test_the_same_irradiance_is_left_out_in_every_spelling(house, tmp_path, unit):
    (tmp_path / "sun.toml").write_text(HOUSE.replace('"sunshine", unit = "W/m2"', f'"sunshine", unit = "{unit}"'))
    frame, hours = measured()
    frame["sun"] = np.where((hours >= 50) & (hours < 52), 5000.0, frame["sun"])
    mapping = MAPPING.replace("[weather.ghi]", "[variables.sunshine]")
    report = house(frame, mapping, system=tmp_path / "sun.toml")
    wrong = int((frame["sun"] == 5000.0).sum())
    (note,) = [one for one in report.notes if one.startswith("column sun") and "left out" in one]
    assert note.startswith(f"column sun: {wrong} of {len(frame)} readings are left out: not -20 to 1500 W/m2")


def test_a_register_is_told_where_power_is_in_kilowatts(house, tmp_path):
    (tmp_path / "kilo.toml").write_text(HOUSE.replace('name = "gas", unit = "W"', 'name = "gas", unit = "kW"'))
    frame, hours = measured()
    frame["kilowatts"] = 1000.0 + 0.3 * hours
    notes = house(frame, system=tmp_path / "kilo.toml").notes
    assert any(note.startswith("column kilowatts: hardly ever falls, from 1000 to") for note in notes)


@pytest.mark.parametrize(("unit", "asked"), [("ppm", False), ("1", True)])
def test_small_percentages_are_questioned_only_where_they_can_be_fractions(house, tmp_path, unit, asked):
    (tmp_path / "share.toml").write_text(HOUSE.replace('name = "air", unit = "kg/s"', f'name = "air", unit = "{unit}"'))
    frame, hours = measured()
    frame["valve"] = 0.06 + 0.02 * np.sin(hours)
    mapping = MAPPING.replace('unit = "m3/h"\nscale = 2.4', 'unit = "percent"').replace("fill = 0.0\n", "")
    notes = house(frame, mapping, system=tmp_path / "share.toml").notes
    assert any("is it a fraction" in note for note in notes) == asked
