"""Readings that are something else than they are declared as."""

from datetime import timedelta

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from diagnosis.measurements import import_recording
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import HOUSE, MAPPING, ZONE, measured


def told(report, words):
    return any(words in note for note in report.notes)


def test_what_is_as_declared_is_not_suspected(house):
    report = house(measured()[0])
    for words in ("register", "logged when it", "clear sky's", "the sun at longitude", "run by it"):
        assert not told(report, words), report.notes


def test_a_register_is_told_from_a_power(house):
    frame, hours = measured()
    frame["kilowatts"] = np.where(hours == 50, 0.0, 1000.0 + 0.3 * hours)  # one reading was lost
    assert told(house(frame), "column kilowatts: hardly ever falls, from 1e+06 to")


def on_change(frame):
    """Presence as a logger writes it that only writes changes."""
    changed = frame["presence"].diff().fillna(1.0) != 0
    return frame.assign(presence=frame["presence"].where(changed).astype("Int64").astype("string").fillna(""))


def test_persons_that_are_logged_when_they_change_are_no_lines(house):
    frame, _ = measured()
    mapping = MAPPING.replace('persons = 2.0\nreading = "mean"', "persons = 2.0")
    with pytest.raises(RecordingError, match=r"presence'.* is read every .* h only, .* expected\s+reading = 'hold'"):
        house(on_change(frame), mapping)
    hold = MAPPING.replace('persons = 2.0\nreading = "mean"', 'persons = 2.0\nreading = "hold"')
    every = xr.load_dataset(house(frame, hold, out="every.nc").recording)
    xr.testing.assert_equal(xr.load_dataset(house(on_change(frame), hold, out="changes.nc").recording), every)


def test_an_irradiance_in_another_unit_is_told(house):
    frame, _ = measured()
    assert told(house(frame.assign(sun=frame["sun"] / 1000)), "of a clear sky's in its best hours: check its unit")


def universal(frame):
    """The same rows with stamps in UTC."""
    stamps = pd.date_range("2022-10-27 22:00", periods=len(frame), freq=timedelta(minutes=10))
    return frame.assign(when=stamps.strftime("%Y-%m-%d %H:%M:%S"))


def test_another_zone_than_the_places_is_told(house):
    frame, _ = measured()
    far = house(frame, MAPPING.replace("longitude = 5.0", "longitude = -35.0"), out="far.nc")
    assert told(far, "ahead of the sun at longitude -35: check time.zone and place")
    for k, zone in enumerate(("UTC", "Etc/UTC", "Zulu")):
        utc = house(universal(frame), MAPPING.replace("Europe/Amsterdam", zone), out=f"utc-{k}.nc")
        assert told(utc, f"time.zone is {zone}: days, schedules and habits")


def test_a_sun_that_mostly_shines_by_night_is_refused(house, tmp_path):
    frame, _ = measured()
    antipodes = MAPPING.replace("longitude = 5.0", "longitude = -175.0")
    with pytest.raises(
        RecordingError,
        match=r"mapping.toml: weather: 100% of the irradiance comes while the sun is down at latitude 52, longitude"
        r" -175; expected most of it by day: .* \(standard time of Europe/Amsterdam is",
    ):
        house(frame, antipodes)
    assert not (tmp_path / "out").exists()
    # what is left in the months without a sun is an offset, and no reason
    polar = MAPPING.replace("latitude = 52.0", "latitude = 89.0")
    offset = house(frame.assign(sun=1.0 + 0.5 * np.sin(np.arange(len(frame)))), polar, out="polar.nc")
    assert told(offset, "100% of the irradiance comes while the sun is down")


def test_stamps_in_utc_of_a_place_that_has_a_zone(house):
    """The same recording as of stamps on the wall clock."""
    frame, _ = measured()
    wall = xr.load_dataset(house(frame, out="wall.nc").recording)
    report = house(universal(frame), MAPPING.replace("[place]", 'stamps = "UTC"\n[place]'), out="universal.nc")
    xr.testing.assert_equal(xr.load_dataset(report.recording), wall)
    assert report.zone == str(ZONE)


def test_persons_keep_the_possible_values_of_a_presence(house):
    frame, _ = measured()
    report = house(frame, MAPPING.replace("persons = 2.0", "persons = 2.0\nvalid = [0, 1]"))
    (people,) = [one for one in report.variables if one.name == "people"]
    assert people.impossible == 0 and people.maximum == 2.0


def test_what_is_left_out_as_impossible_is_told_with_its_limits(house):
    """A reading of a boiler's water in a column of the room."""
    frame, hours = measured()
    frame["room"] = np.where((hours > 40) & (hours < 41), 75.0, frame["room"])
    report = house(frame)
    count = int(((hours > 40) & (hours < 41)).sum())
    assert told(report, f"column room: {count} of {len(frame)} readings are left out: not -50 to 60 degC")
    assert told(report, "valid = [lowest, highest] says what else is possible")
    wider = MAPPING.replace("[variables.warmth]", "[variables.warmth]\nvalid = [-20, 90]")
    assert not told(house(frame, wider, out="wider.nc"), "column room: ")
    narrower = MAPPING.replace("[variables.warmth]", "[variables.warmth]\nvalid = [-20, 50]")
    assert told(house(frame, narrower, out="narrower.nc"), "readings are left out: not -20 to 50 degC")


def test_an_input_in_another_unit_than_its_weather_is_refused(tmp_path):
    (tmp_path / "house.toml").write_text(
        HOUSE.replace('name = "outdoors", unit = "K"', 'name = "outdoors", unit = "degC"')
    )
    (tmp_path / "mapping.toml").write_text(MAPPING)
    measured()[0].to_csv(tmp_path / "data.csv", index=False)
    with pytest.raises(RecordingError, match=r"inputs 'outdoors': unit is 'degC'; expected 'K', the unit of weather"):
        import_recording(tmp_path / "mapping.toml", tmp_path / "data.csv", out=tmp_path / "out.nc")


def test_rows_that_end_in_a_separator_keep_their_columns(house, tmp_path):
    frame, _ = measured()
    whole = xr.load_dataset(house(frame, out="whole.nc").recording)
    text = frame.to_csv(index=False).splitlines()
    (tmp_path / "ends.csv").write_text("\n".join([text[0], *(line + "," for line in text[1:])]))
    report = import_recording(tmp_path / "mapping.toml", tmp_path / "ends.csv", out=tmp_path / "ends.nc")
    xr.testing.assert_equal(xr.load_dataset(report.recording), whole)
    (tmp_path / "more.csv").write_text("\n".join([text[0], *(line + ",7" for line in text[1:])]))
    with pytest.raises(RecordingError, match="rows have 10 fields under 9 column names"):
        import_recording(tmp_path / "mapping.toml", tmp_path / "more.csv", out=tmp_path / "more.nc")


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S %Z", "%Y-%m-%d %H:%M:%S +02:00"])
def test_letters_and_fixed_offsets_in_a_format_are_refused(house, form):
    with pytest.raises(RecordingError, match=r"time.format is .* expected %z"):
        house(measured()[0], MAPPING.replace("[time]", f'[time]\nformat = "{form}"'))


def test_an_offset_without_colons_is_a_sentence(house):
    frame, _ = measured()
    frame["when"] = [one.replace(" ", "T").replace("-", "").replace(":", "") + "Z" for one in frame["when"]]
    with pytest.raises(RecordingError):
        house(frame)


def test_long_gaps_of_a_dew_point_are_told(house):
    frame, hours = measured()
    mapping = MAPPING + '[weather.temp_dew]\ncolumn = "dew"\nunit = "degC"\n'
    dew = 3.0 + np.sin(hours)
    assert not told(house(frame.assign(dew=dew), mapping), "column dew, which it is computed with")
    gap = house(frame.assign(dew=np.where((hours > 50) & (hours < 98), np.nan, dew)), mapping, out="gap.nc")
    assert told(gap, "of its readings column dew, which it is computed with, has gaps of up to 48 h, which")
    both = frame.assign(dew=dew, outside=frame["outside"])
    both.loc[(hours > 50) & (hours < 98), ["dew", "outside"]] = np.nan  # nothing is computed there
    assert not told(house(both, mapping, out="both.nc"), "column dew, which it is computed with")


@pytest.mark.parametrize("key", ["weather.poa_global", "variables.sunshine"])
def test_a_sun_on_the_facade_that_shines_by_night_is_refused(house, tmp_path, key):
    """A clock that is half a day wrong; by day, a facade has some light before the sun rises and after it sets."""
    frame, hours = measured()
    mapping = MAPPING.replace("weather.ghi", key)
    said = (
        rf"mapping.toml: {key}: 100% of the irradiance comes while the sun is down at latitude 52, longitude -175; exp"
    )
    with pytest.raises(RecordingError, match=said):
        house(frame, mapping.replace("longitude = 5.0", "longitude = -175.0"))
    assert not (tmp_path / "out").exists()
    # the sun rises at 8:25 h and sets at 18:20 h of summer time; half an hour before and after is light
    hour = hours % 24
    twilight = np.where((hour > 7.9) & (hour < 18.9), 4.0, 0.0)
    sun = np.maximum(300 * np.sin(np.pi * (hour - 8.4) / 9.9), 0) * (hour > 8.4)
    report = house(frame.assign(sun=np.maximum(sun, twilight)), mapping)
    assert not told(report, "comes while the sun is down")


def test_persons_that_the_mapping_states_are_said_to_count_as_counted(house):
    """The description says which input they are; a constant of any other quantity is no count."""
    frame, _ = measured(days=2)
    stated = 'constant = 2.0\nunit = "persons"'
    counted = 'column = "presence"\nunit = "presence"\npersons = 2.0\nreading = "mean"'
    report = house(frame, MAPPING.replace(counted, stated))
    assert told(
        report, "people: 2 occupants at all hours, nights too, as the mapping states: a calibration, forecast or"
    )
    assert (xr.load_dataset(report.recording)["people"].values == 2.0).all()
    valve = 'column = "valve"\nunit = "m3/h"\nscale = 2.4\nreading = "mean"\nfill = 0.0'
    other = house(frame, MAPPING.replace(valve, 'constant = 50.0\nunit = "m3/h"'), out="other.nc")
    assert not told(other, "as the mapping states")


def test_zeros_and_ones_are_hardly_a_count(house):
    frame, _ = measured()
    count = MAPPING.replace('unit = "presence"\npersons = 2.0', 'unit = "persons"')
    assert told(
        house(frame, count, out="count.nc"),
        "people: column presence holds only 0 and 1, taken for a count, and the description has up to 2 persons; is it"
        " presence? then write unit = 'presence'",
    )
    assert not told(house(frame, out="presence.nc"), "only 0 and 1")
    assert not told(house(frame.assign(presence=2 * frame["presence"]), count, out="two.nc"), "only 0 and 1")
