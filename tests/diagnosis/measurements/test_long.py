"""A file with a row for each reading: the same recording as from a column for each sensor."""

import tomllib
from datetime import UTC, datetime

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from diagnosis.measurements.draft import draft_mapping
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import MAPPING, measured

LONG = MAPPING.replace("[time]", '[file]\nnames = "entity_id"\nvalues = "state"\n[time]')


def long(frame):
    """Blocks of rows, a sensor after the other, as Home Assistant exports them; a lost reading is a word."""
    made = frame.drop(columns="not mapped").melt("when", var_name="entity_id", value_name="state")
    made["state"] = made["state"].astype(str)
    made["when"] = pd.to_datetime(made["when"]).dt.strftime("%Y-%m-%dT%H:%M:%S.000Z")
    made.loc[len(made) // 3, "state"] = "unavailable"
    return made[["entity_id", "state", "when"]]


def recorded(report):
    return xr.load_dataset(report.recording)


def test_the_recording_is_that_of_columns(house):
    frame, _ = measured(first=datetime(2022, 10, 10, 22, 0, tzinfo=UTC))
    frame["when"] = frame["when"] + "+00:00"
    apart = recorded(house(frame.drop(columns="not mapped")))
    made = long(frame)
    found = recorded(house(made, LONG.replace("[time]", 'missing = ["", "unavailable"]\n[time]'), out="long.nc"))
    same = 0
    for name in ("warmth", "gas", "outdoors", "sunshine", "people", "air"):
        wide, tall = apart[name].values, found[name].values
        same += int(np.sum(np.isfinite(wide) != np.isfinite(tall)))
        both = np.isfinite(wide) & np.isfinite(tall)
        np.testing.assert_allclose(tall[both], wide[both], rtol=1e-3, atol=1e-6)
    assert same <= 1  # the lost reading


@pytest.mark.parametrize("shuffled", [False, True])
def test_a_draft_sees_it(tmp_path, shuffled):
    frame, _ = measured()
    names = {
        "room": "sensor.living_room_temperature",
        "outside": "sensor.outdoor_temperature_c",
        "kilowatts": "heating [kW]",
    }
    made = long(frame[["when", *names, "not mapped"]].rename(columns=names))
    if shuffled:
        made = made.sort_values("when", kind="stable")
    made.to_csv(tmp_path / "log.csv", index=False)
    draft_mapping(tmp_path / "log.csv", out=tmp_path / "drafted.toml")
    drafted = tomllib.loads((tmp_path / "drafted.toml").read_text())
    assert (drafted["file"]["names"], drafted["file"]["values"]) == ("entity_id", "state")
    assert "unavailable" in drafted["file"]["missing"]
    assert drafted["variables"]["TRoo"]["column"] == "sensor.living_room_temperature"
    assert drafted["variables"]["QHea"]["column"] == "heating [kW]"
    assert drafted["weather"]["temp_air"]["column"] == "sensor.outdoor_temperature_c"


def test_a_column_of_words_beside_one_of_numbers_is_no_long_file(tmp_path):
    frame, _ = measured()
    made = pd.DataFrame(
        {"when": frame["when"], "room temp C": frame["room"], "mode": np.resize(["auto", "eco"], len(frame))}
    )
    made.to_csv(tmp_path / "log.csv", index=False)
    draft_mapping(tmp_path / "log.csv", out=tmp_path / "drafted.toml")
    assert "names" not in tomllib.loads((tmp_path / "drafted.toml").read_text()).get("file", {})


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ('names = "sensor"\nvalues = "state"', r"file.names and file.values: no column 'sensor', or several; found"),
        ('names = "entity_id"', "file: has one of names and values; expected both, or neither"),
    ],
)
def test_a_wrong_name_is_a_sentence(house, written, said):
    frame, _ = measured()
    with pytest.raises(RecordingError, match=said):
        house(long(frame), MAPPING.replace("[time]", f"[file]\n{written}\n[time]"))
