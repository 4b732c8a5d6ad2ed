"""Drafts of mappings: what the columns of a log are taken for, and what a filled-in draft imports to."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from diagnosis.measurements.command import import_
from diagnosis.measurements.draft import draft_mapping
from diagnosis.measurements.importer import import_recording
from shared.console import FAULT, OK, new_app, start
from shared.errors import RecordingError
from tests.diagnosis.measurements.house_cases import HOUSE, measured

EXAMPLE = Path(__file__).resolve().parents[3] / "docs" / "example"
ZONE = "America/New_York"
TRUTH = {
    "room_degC": "variables.TRoo",
    "co2_ppm": "variables.CO2",
    "heater_kW": "variables.QHea",
    "fresh_air_m3_h": "variables.mOA",
    "outdoor_degC": "weather.temp_air",
    "wind_m_s": "weather.wind_speed",
    "sun_horizontal_W_m2": "weather.ghi",
}
NAMES = {
    "time": ("Datum/Uhrzeit", "time", "time", "Timestamp"),
    "room_degC": ("Raumtemperatur [°C]", "Température salle (°C)", "ruimtetemperatuur", "Zone Temp"),
    "co2_ppm": ("CO2 Büro [ppm]", "CO2 intérieur", "CO2 binnen", "Zone CO2"),
    "heater_kW": ("Heizleistung [kW]", "Puissance de chauffage (kW)", "verwarmingsvermogen kW", "Heating Power (W)"),
    "fresh_air_m3_h": (
        "Frischluft-Volumenstrom [m³/h]",
        "Débit air neuf (m3/h)",
        "verse lucht m3/h",
        "OA Flow (CFM)",
    ),
    "outdoor_degC": ("Außentemperatur [°C]", "Température extérieure (°C)", "buitentemperatuur", "OA Temp"),
    "wind_m_s": ("Windgeschwindigkeit [m/s]", "Vitesse du vent (m/s)", "windsnelheid", "Wind Speed (mph)"),
    "sun_horizontal_W_m2": ("Globalstrahlung [W/m²]", "Rayonnement global (W/m2)", "globale zonnestraling", "GHI"),
}
GERMAN, FRENCH, DUTCH, AMERICAN = (dict(zip(NAMES, some, strict=True)) for some in zip(*NAMES.values(), strict=True))


@pytest.fixture(scope="module")
def log():
    return pd.read_csv(EXAMPLE / "measurements.csv")


def placed(draft):
    return {one.column: one.to for one in draft.guesses if one.to}


def named(words):
    return {words.get(name, name): to for name, to in TRUTH.items()}


def filled_in(path):
    """A draft with what only its user knows."""
    text = path.read_text(encoding="utf-8").replace('zone = "?"  # the clock', f'zone = "{ZONE}"  # the clock')
    text = re.sub(r'^latitude = "\?"', "latitude = 36.1\naltitude = 273.0", text, flags=re.MULTILINE)
    text = re.sub(r'^longitude = "\?"', "longitude = -79.95", text, flags=re.MULTILINE)
    path.write_text(re.sub(r'^persons = "\?"', "persons = 3.0", text, flags=re.MULTILINE), encoding="utf-8")
    return path


def german(frame, path):
    """What an Excel of a German office saves as CSV."""
    frame = frame.assign(time=pd.to_datetime(frame["time"]).dt.strftime("%d.%m.%Y %H:%M")).rename(columns=GERMAN)
    frame.to_csv(path, index=False, sep=";", decimal=",", encoding="cp1252")
    return named(GERMAN)


def two_headers(frame, path):
    """Lines about the file, names, units, and date and time apart."""
    time = pd.to_datetime(frame["time"])
    frame = frame.rename(columns={name: name.rpartition("_degC")[0] or name for name in frame}).drop(columns="time")
    frame.insert(0, "date", time.dt.strftime("%d/%m/%Y"))
    frame.insert(1, "clock", time.dt.strftime("%I:%M:%S %p"))
    names, *rows = frame.to_csv(index=False, sep="\t").splitlines()
    units = "\t\t°C\tppm\tkW\tm3/h\t°C\tm/s\tW/m²"
    path.write_text(
        "\n".join(["Plant 7\texport", "Period\t01/01/2001 00:00\t22/01/2001 00:00", "", names, units, *rows]),
        encoding="utf-8",
    )
    return {name.removesuffix("_degC"): to for name, to in TRUTH.items()}


def american(frame, path):
    frame = frame.assign(
        time=pd.to_datetime(frame["time"]).dt.strftime("%m/%d/%Y %I:%M %p"),
        room_degC=frame["room_degC"] * 1.8 + 32,
        outdoor_degC=frame["outdoor_degC"] * 1.8 + 32,
        heater_kW=frame["heater_kW"] * 1000,
        fresh_air_m3_h=frame["fresh_air_m3_h"] / 1.69901082,
        wind_m_s=frame["wind_m_s"] / 0.44704,
    )
    frame.rename(columns=AMERICAN).to_csv(path, index=False)
    return named(AMERICAN)


def french(frame, path):
    time = (pd.to_datetime(frame["time"]).dt.tz_localize(ZONE) - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(1, "ms")
    frame.assign(time=time.astype("int64"))[frame.columns[::-1]].rename(columns=FRENCH).to_csv(
        path, sep="|", index=False
    )
    return named(FRENCH)


def dutch(frame, path):
    """Offsets in the stamps, numbers of the rows, and their name lost."""
    time = pd.to_datetime(frame["time"]).dt.tz_localize(ZONE)
    frame.assign(time=[one.isoformat() for one in time]).rename(columns=DUTCH).to_csv(path)
    return named(DUTCH)


@pytest.fixture(scope="module")
def by_hand(tmp_path_factory):
    """The example by its own mapping."""
    out = tmp_path_factory.mktemp("hand") / "hand.nc"
    import_recording(EXAMPLE / "mapping.toml", EXAMPLE / "measurements.csv", out=out)
    return xr.load_dataset(out)


def as_it_is(frame, path):
    frame.to_csv(path, index=False)
    return TRUTH


@pytest.mark.parametrize("write", [as_it_is, german, two_headers, american, french, dutch])
def test_a_filled_in_draft_imports_to_what_the_mapping_by_hand_does(log, by_hand, tmp_path, write):
    truth = write(log, tmp_path / "log.csv")
    draft = draft_mapping(tmp_path / "log.csv", out=tmp_path / "mapping.toml")
    assert placed(draft) == truth
    zone = [] if write is dutch else ["time.zone"]
    assert draft.to_fill_in == [*zone, "place.latitude", "place.longitude"]
    expected = r"has '\?' where something has to be filled in: .*place\.latitude \(degrees"
    with pytest.raises(RecordingError, match=expected):
        import_recording(tmp_path / "mapping.toml", tmp_path / "log.csv", out=tmp_path / "log.nc")
    import_recording(filled_in(tmp_path / "mapping.toml"), tmp_path / "log.csv", out=tmp_path / "log.nc")
    drafted = xr.load_dataset(tmp_path / "log.nc")
    assert drafted.sizes == by_hand.sizes
    for name in by_hand.data_vars:
        if by_hand[name].dtype.kind == "f":
            np.testing.assert_allclose(drafted[name], by_hand[name], rtol=2e-6, atol=1e-6, err_msg=str(name))


def test_what_a_name_does_not_tell_is_left_open(log, tmp_path):
    """A wrong column would be used without a word."""
    traps = {
        "outdoor_forecast_degC": log["outdoor_degC"],
        "room_degC_max": log["room_degC"] + 1,
        "supply_degC": 30.0 + log["room_degC"] / 10,
        "vorlauf temp": 45.0 + log["room_degC"] / 2,
        "floor temperature": log["room_degC"] + 0.5,
        "lighting_kW": log["heater_kW"] / 10,
        "AI_17": log["room_degC"] + 0.1,
        "window": (log["co2_ppm"] < 420).astype(int),
    }
    log.assign(**traps).to_csv(tmp_path / "log.csv", index=False)
    draft = draft_mapping(tmp_path / "log.csv", out=tmp_path / "mapping.toml")
    assert placed(draft) == TRUTH
    assert all(f'# column = "{name}"' in draft.text for name in traps)
    # supply air may be all outdoor air: that is for the engineer to say
    log.rename(columns={"fresh_air_m3_h": "Zuluft [m3/h]"}).to_csv(tmp_path / "log.csv", index=False)
    draft = draft_mapping(tmp_path / "log.csv", out=tmp_path / "supply.toml")
    assert "variables.mOA" not in placed(draft).values()
    assert "write mOA for the ? if this is the same here" in draft.text
    # rooms of which nobody says which one is modelled
    frame = log.assign(**{f"Room {k} T [°C]": log["room_degC"] + k - 101 for k in (101, 102)}).drop(columns="room_degC")
    frame.to_csv(tmp_path / "log.csv", index=False)
    draft = draft_mapping(tmp_path / "log.csv", out=tmp_path / "rooms.toml")
    assert "variables.TRoo" not in placed(draft).values()
    assert "and so may Room 102 T [°C]: of several rooms?" in draft.text
    # two temperatures without a place, and values that are none of what the name says
    frame = log[["time"]].assign(temp1=log["room_degC"], temp2=log["outdoor_degC"], room_degC=log["co2_ppm"])
    frame.to_csv(tmp_path / "log.csv", index=False)
    assert placed(draft_mapping(tmp_path / "log.csv", out=tmp_path / "other.toml")) == {}


def test_a_system_of_other_names_and_a_second_meter(tmp_path):
    (tmp_path / "house.toml").write_text(HOUSE)
    frame = measured(days=6)[0].rename(
        columns={"room": "room temperature [°C]", "room 2": "meter room temperature [°F]", "outside": "outside [°C]"}
    )
    frame.assign(**{"heating energy [kWh]": frame.pop("kilowatts") / 6}).to_csv(tmp_path / "log.csv", index=False)
    draft = draft_mapping(tmp_path / "log.csv", tmp_path / "house.toml", out=tmp_path / "mapping.toml")
    assert placed(draft) == {
        "room temperature [°C]": "variables.warmth",
        "presence": "variables.people",
        "sun": "weather.ghi",
        "outside [°C]": "weather.temp_air",
    }
    assert 'compare = { column = "meter room temperature [°F]", unit = "degF" }' in draft.text
    assert 'system = "house.toml"' in draft.text


def test_energy_within_each_interval_is_a_power(log, tmp_path):
    frame = log.rename(columns={"heater_kW": "heating energy [Wh]"})
    frame.assign(time=pd.date_range("2001-01-01", periods=len(log), freq="15min")).to_csv(
        tmp_path / "log.csv", index=False
    )
    text = draft_mapping(tmp_path / "log.csv", out=tmp_path / "mapping.toml").text
    assert re.search(r'column = "heating energy \[Wh\]"\nunit = "W" .*\nscale = 4\.0\n', text)


def test_the_command(log, tmp_path, capsys):
    log.to_csv(tmp_path / "log.csv", index=False)
    app = new_app("diagnosis", "")
    app.command(import_, name="import")
    words = ["import", "--draft", str(tmp_path / "log.csv"), "--out", str(tmp_path / "mapping.toml")]
    assert start(app, words) == OK
    said = capsys.readouterr().out
    assert "variables.TRoo" in said and "fill in time.zone, place.latitude, place.longitude" in said
    assert start(app, words) == FAULT
    assert "is there already" in capsys.readouterr().err
    assert start(app, [*words[:-1], str(tmp_path / "other.toml"), "--json"]) == OK
    assert json.loads(capsys.readouterr().out)["to_fill_in"][0] == "time.zone"
    assert start(app, ["import", str(tmp_path / "mapping.toml")]) == FAULT
    assert "expected import mapping.toml log.csv --out recording.nc" in capsys.readouterr().err
