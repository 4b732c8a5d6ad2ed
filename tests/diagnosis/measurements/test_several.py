"""A room's log and a weather station's, each with a mapping, make one recording."""

from pathlib import Path

import pandas as pd
import pytest
import xarray as xr

from diagnosis.measurements.importer import import_recording
from shared.errors import RecordingError

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "example"
OUTDOORS = ["outdoor_degC", "wind_m_s", "sun_horizontal_W_m2"]
STATION = """schema_version = 1
source = "the airport"
[file]
separator = ";"
decimal = ","
[time]
column = "utc"
zone = "UTC"
[place]
latitude = 36.1
longitude = -79.95
altitude = 273.0
[weather.temp_air]
column = "outdoor_degC"
unit = "degC"
stuck_after = 24.0
[weather.wind_speed]
column = "wind_m_s"
unit = "m/s"
[weather.ghi]
column = "sun_horizontal_W_m2"
unit = "W/m2"
"""


@pytest.fixture
def logs(tmp_path):
    """The example's log in two: the room's columns as they are, the weather's in UTC, with a day more on either side.

    Returns what an import takes.
    """
    whole = pd.read_csv(EXAMPLE / "measurements.csv")
    whole.drop(columns=OUTDOORS).to_csv(tmp_path / "room.csv", index=False)
    mapping = (EXAMPLE / "mapping.toml").read_text()
    place, variables = mapping.index("# where the building stands"), mapping.index("[variables.TRoo]")
    weather = mapping.index("# a mild rainy night")
    (tmp_path / "room.toml").write_text(mapping[:place] + mapping[variables:weather])
    outside = whole[OUTDOORS].set_index(pd.to_datetime(whole["time"]) + pd.Timedelta(hours=5))
    day = pd.Timedelta(days=1)
    outside = pd.concat(
        [outside[:24].set_index(outside.index[:24] - day), outside, outside[-24:].set_index(outside.index[-24:] + day)]
    )
    outside.rename_axis("utc").to_csv(tmp_path / "station.csv", sep=";", decimal=",")
    (tmp_path / "station.toml").write_text(STATION)
    return [tmp_path / name for name in ("room.toml", "room.csv", "station.toml", "station.csv")]


def test_two_logs_are_the_recording_of_one(logs, tmp_path):
    report = import_recording(*logs, out=tmp_path / "two.nc")
    import_recording(EXAMPLE / "mapping.toml", EXAMPLE / "measurements.csv", out=tmp_path / "one.nc")
    with xr.open_dataset(tmp_path / "two.nc") as two, xr.open_dataset(tmp_path / "one.nc") as one:
        # the station's further days are seen at the ends, where the sky's clouds are taken from the sun about noon
        assert two.sizes == one.sizes
        inner = slice(24, -24)
        xr.testing.assert_allclose(two.drop_attrs().isel(time=inner), one.drop_attrs().isel(time=inner))
        assert two.attrs["source_file"] == "room.csv, station.csv"
        assert two.attrs["source"].endswith("; the airport")
    assert not report.unused_columns and [one.split(" (")[0] for one in report.lacking] == [
        "occupants were not counted"
    ]
    assert any("station.csv: " in note and note.endswith("clock of UTC") for note in report.notes)


def test_a_log_of_another_time_or_without_its_pair_is_refused(logs, tmp_path):
    late = pd.read_csv(logs[3], sep=";")
    late["utc"] = (pd.to_datetime(late["utc"]) + pd.Timedelta(days=365)).dt.strftime("%Y-%m-%d %H:%M")
    late.to_csv(tmp_path / "late.csv", sep=";", index=False)
    with pytest.raises(
        RecordingError, match=r"late.csv: is of 2001-12-31.* to 2002-.* expected measurements between 2001-01-0"
    ):
        import_recording(*logs[:3], tmp_path / "late.csv", out=tmp_path / "two.nc")
    with pytest.raises(RecordingError, match=r"station.toml: expected a mapping \(TOML\) and its measurements in turn"):
        import_recording(*logs[:3], out=tmp_path / "two.nc")
    assert not (tmp_path / "two.nc").exists()


def test_what_two_mappings_bring_is_refused_with_all_other_mistakes(logs, tmp_path):
    logs[2].write_text(STATION + '[variables.TRoo]\ncolumn = "wind"\nunit = "degC"\n')
    logs[0].write_text(logs[0].read_text().replace("[variables.CO2]", "[variables.CO3]"))
    with pytest.raises(RecordingError) as found:
        import_recording(*logs, out=tmp_path / "two.nc")
    first, second, third = str(found.value).splitlines()
    assert "station.csv has not all columns" in third
    assert "room.toml: variables: 'CO3' is neither" in first
    assert "station.toml: variables.TRoo: is in" in second and "room.toml, too; expected it in one of them" in second
