"""A CSV with all that goes wrong in measurements becomes a recording; what cannot becomes a sentence and no file."""

import json
import os
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.image import imread

from diagnosis import residuals
from diagnosis.importing import import_recording
from diagnosis.importing.command import import_
from diagnosis.importing.quality import ASSUMED, COMPUTED, IMPOSSIBLE, INTERPOLATED, MISSING, PARTLY, STUCK
from diagnosis.recording import read_recording
from shared.console import FAULT, OK, new_app, start
from shared.errors import RecordingError
from shared.schema import EPOCH
from shared.system import load_system

ROOT = Path(__file__).resolve().parents[3]
OFFICE = ROOT / "fmus" / "MixedAirCO2" / "office.toml"
ZONE = ZoneInfo("Europe/Amsterdam")

# names that no other system of ours has: nothing in the import may know a name
HOUSE = """
schema_version = 1
name = "House"
fmu = "none.fmu"
experiment = { step = 1800.0, hours = 24.0 }
estimator = { channels = ["warmth"] }
parameters = [{ name = "UA", unit = "W/K", min = 1.0, max = 9.0 }]
outputs = [
  { name = "warmth", unit = "K", accuracy = 0.1 },
  { name = "gas", unit = "W", accuracy = 1.0, method = "mean" },
]
inputs = [
  { name = "outdoors", unit = "K", source = "weather", column = "temp_air" },
  { name = "sky", unit = "K", source = "weather", column = "temp_sky" },
  { name = "sunshine", unit = "W/m2", source = "weather", column = "poa_global" },
  { name = "people", unit = "1", source = "occupancy" },
  { name = "air", unit = "kg/s", source = "measured", column = "air", interpolation = "previous" },
  { name = "wish", unit = "K", source = "schedule", schedule = "wish" },
  { name = "nothing", unit = "1", source = "constant", value = 3.0 },
]
weather = { files = ["pvlib:723170TYA.CSV"] }
schedules = { wish = { weekday = [[0.0, 290.0], [6.5, 294.0]], weekend = [[0.0, 289.0]] } }
[occupancy]
headcount = [1, 2]
arrival = [7.0, 9.0]
duration = [7.0, 9.0]
jitter = 0.5
attendance = [0.4, 1.0]
gaps = [0, 1]
gap_duration = [0.4, 1.5]
gap_share = [0.3, 1.0]
absence = 0.05
weekend = 0.15
"""
MAPPING = """
schema_version = 1
system = "house.toml"
[time]
column = "when"
zone = "Europe/Amsterdam"
[place]
latitude = 52.0
longitude = 5.0
[variables.warmth]
column = "room"
unit = "degC"
compare = { column = "room 2", unit = "degF" }
[variables.gas]
column = "kilowatts"
unit = "kW"
reading = "mean"
[variables.people]
column = "presence"
unit = "presence"
persons = 2.0
reading = "mean"
[variables.air]
column = "valve"
unit = "m3/h"
scale = 2.4
reading = "mean"
fill = 0.0
[weather.temp_air]
column = "outside"
unit = "degC"
[weather.ghi]
column = "sun"
unit = "W/m2"
"""


@pytest.fixture(autouse=True)
def undrawn(request, monkeypatch):
    """Drawing takes most of an import's time: only tests of the picture draw it."""
    if "picture" not in request.node.name:
        monkeypatch.setattr("diagnosis.importing.importer.draw_recording", lambda *_: b"no picture")


def warmth(hours):
    return 21.0 + 2.0 * np.sin(2 * np.pi * hours / 24)


def measured(days=6, minutes=10, first=datetime(2022, 10, 27, 22, 0, tzinfo=UTC), jitter=0.0):
    """Rows of a logger on the wall clock across the end of daylight saving; time in hours since the first row."""
    rng = np.random.default_rng(3)
    minute = np.arange(0, days * 1440 + 1, minutes, dtype=float)
    minute[1:-1] += jitter * minutes * rng.uniform(-0.4, 0.4, len(minute) - 2)
    when = [first + timedelta(minutes=round(m, 1)) for m in minute]
    hours = np.array([(t - first).total_seconds() / 3600 for t in when])
    frame = pd.DataFrame(
        {
            "when": [t.astimezone(ZONE).replace(tzinfo=None).isoformat(sep=" ") for t in when],
            "room": warmth(hours),
            "room 2": (warmth(hours) - 0.5) * 1.8 + 32,
            "kilowatts": 1.0 + np.cos(2 * np.pi * hours / 24),
            "presence": ((hours % 24 > 9) & (hours % 24 <= 17)).astype(int),
            "valve": np.full(len(hours), 50.0),
            "outside": 8.0 + 3.0 * np.sin(2 * np.pi * hours / 24),
            "sun": np.maximum(300 * np.sin(2 * np.pi * (hours % 24 - 7) / 20), 0) * (hours % 24 < 17),
            "not mapped": 1.0,
        }
    )
    return frame, hours


@pytest.fixture
def house(tmp_path):
    """Write mapping, system and data; import them; return the report."""

    def run(frame, mapping=MAPPING, out="out/house.nc"):
        (tmp_path / "house.toml").write_text(HOUSE)
        (tmp_path / "mapping.toml").write_text(mapping)
        frame.to_csv(tmp_path / "data.csv", index=False)
        return import_recording(tmp_path / "mapping.toml", tmp_path / "data.csv", out=tmp_path / out)

    return run


def steps_of(report):
    data = xr.load_dataset(report.recording, decode_times=False)
    zero = datetime.fromisoformat(data["time"].attrs["units"].removeprefix("seconds since ")).replace(tzinfo=UTC)
    # local standard time of Amsterdam is an hour before UTC; the first row is at 22:00 UTC
    first = datetime(2022, 10, 27, 23, 0, tzinfo=UTC)
    return data, data["time"].values / 3600 + (zero - first).total_seconds() / 3600


@pytest.mark.parametrize("jitter", [0.0, 1.0])
def test_values_are_those_of_their_time(house, jitter):
    """Instants at the ends of the steps, means over them, in the system's units, whatever the sampling."""
    frame, _ = measured(jitter=jitter)
    report = house(frame)
    data, hours = steps_of(report)
    assert report.steps == len(hours) == pytest.approx(6 * 48, abs=1)
    np.testing.assert_allclose(np.diff(hours), 0.5)
    np.testing.assert_allclose(data["warmth"], warmth(hours) + 273.15, atol=2e-3)
    np.testing.assert_allclose(data["outdoors"], 281.15 + 3 * np.sin(2 * np.pi * hours / 24), atol=3e-3)
    # a mean that was itself read as the instant at its end: half a reading early
    shape = 12 / np.pi / 0.5 * (np.sin(2 * np.pi * hours / 24) - np.sin(2 * np.pi * (hours - 0.5) / 24))
    np.testing.assert_allclose(data["gas"], 1000 * (1 + shape), atol=60)
    assert float(data["gas"].mean()) == pytest.approx(1000, rel=0.01)
    np.testing.assert_allclose(data["air"], 2.4 * 50 / 3600 * 1.2, rtol=1e-6)
    assert float(data["people"].mean()) == pytest.approx(2 * 8 / 24, rel=0.01)
    assert set(np.unique(data["nothing"])) == {3.0}
    assert report.comparisons[0].mean_difference == pytest.approx(0.5, abs=1e-3)
    assert report.comparisons[0].sd_difference < 1e-3
    assert report.unused_columns == ["not mapped"]


def test_the_calendar_is_kept_and_the_week_is_right(house):
    report = house(measured()[0])
    assert (report.begin, report.utc_offset, report.time_zero) == ("2022-10-27 23:00", 1.0, "2022-01-03")
    raw = xr.load_dataset(report.recording, decode_times=False)["time"].values
    dates = pd.DatetimeIndex(xr.load_dataset(report.recording)["time"].values)
    assert dates[0] == pd.Timestamp("2022-10-27 23:30")
    np.testing.assert_array_equal(raw % 86400, dates.hour * 3600 + dates.minute * 60)
    np.testing.assert_array_equal(raw // 86400 % 7, dates.day_of_week)
    # estimators count from the simulated years' time zero: the same remainders
    since = (dates - pd.Timestamp(EPOCH)) / pd.Timedelta(seconds=1)
    np.testing.assert_array_equal(since % (7 * 86400), raw % (7 * 86400))
    wish = xr.load_dataset(report.recording)["wish"].values
    friday, saturday = dates.date == dates[2].date(), dates.date == dates[50].date()
    assert wish[friday].min() == 290.0 and wish[friday].max() == 294.0 and set(wish[saturday][1:]) == {289.0}


def test_what_is_wrong_is_flagged_and_not_used(house):
    frame, hours = measured()
    frame.loc[(hours > 20) & (hours < 23), "room"] = np.nan
    frame.loc[np.isclose(hours, 40.5), "room"] = 85.0
    frame.loc[(hours >= 60) & (hours <= 75), "room"] = 20.25
    frame.loc[(hours > 100) & (hours < 102.1), "outside"] = np.nan
    frame.loc[(hours > 110.1) & (hours < 110.2), "valve"] = np.nan
    frame.loc[(hours > 120) & (hours < 130), "valve"] = np.nan
    report = house(frame)
    data, at = steps_of(report)
    flags = data["warmth_flag"].values
    assert (flags[(at > 20.5) & (at < 22.5)] == MISSING).all()
    assert flags[np.isclose(at, 40.5)] & IMPOSSIBLE and np.isfinite(data["warmth"].values[np.isclose(at, 40.5)])
    stuck = (at > 60) & (at < 75)
    assert ((flags[stuck] & STUCK) > 0).all() and np.isnan(data["warmth"].values[stuck]).all()
    left = ~np.isin(flags, [0]) | np.isnan(data["warmth"].values)
    np.testing.assert_allclose(data["warmth"].values[~left], warmth(at[~left]) + 273.15, atol=2e-3)
    about = {one.name: one for one in report.variables}
    assert (about["warmth"].impossible, about["warmth"].stuck) == (1, 91)
    assert about["outdoors"].interpolated >= 4
    bridged = (data["outdoors_flag"].values & INTERPOLATED) > 0
    assert ((at[bridged] > 100) & (at[bridged] < 102.5)).all()
    assumed = (data["air_flag"].values & ASSUMED) > 0
    assert (data["air"].values[assumed] == 0).all() and ((at[assumed] > 120) & (at[assumed] < 130.5)).all()
    assert ((data["air_flag"].values[np.isclose(at, 110.5)]) & PARTLY) > 0
    assert ((data["sunshine_flag"].values & COMPUTED) > 0).all() and ((data["sky_flag"].values & COMPUTED) > 0).all()
    assert (data["nothing_flag"].values == ASSUMED).all()
    assert data["warmth_flag"].attrs["flag_meanings"].split()[0] == "missing"


def test_an_input_that_stays_missing_cuts_the_recording(house):
    frame, hours = measured()
    frame.loc[(hours > 48) & (hours < 55), "outside"] = np.nan
    report = house(frame)
    _, at = steps_of(report)
    assert at[0] == pytest.approx(55.5, abs=0.6) and at[-1] == pytest.approx(144.0, abs=0.6)
    assert any("outdoors in" in note and "longest stretch" in note for note in report.notes)
    assert all(one.missing == 0 for one in report.variables)


def test_what_is_not_mapped_is_said(house):
    mapping = MAPPING.replace("[variables.people]", "[weather.opaque_cover]").replace("persons = 2.0\n", "")
    mapping = mapping.replace('unit = "presence"\n', 'unit = "fraction"\n')
    report = house(
        measured()[0], mapping.replace('[variables.air]\ncolumn = "valve"', "[variables.air]\nconstant = 50.0")
    )
    assert report.not_recorded == ["people"]
    assert any("measured cloud cover" in note for note in report.notes)
    data, _ = steps_of(report)
    np.testing.assert_allclose(data["air"], 0.04, rtol=1e-6)
    assert "people" not in data


def test_a_wrong_zone_shows_in_the_sun(house):
    frame, _ = measured(first=datetime(2022, 9, 1, 22, 0, tzinfo=UTC), days=3)
    report = house(frame, MAPPING.replace("Europe/Amsterdam", "America/New_York"))
    assert any("ahead of the sun" in n or "behind the sun" in n for n in report.notes)
    assert any("while the sun is down" in n for n in report.notes)


@pytest.mark.parametrize(
    ("change", "mapping", "said"),
    [
        (None, MAPPING.replace('"room"\nunit = "degC"', '"room"\nunit = "K"'), r"variables.warmth.*median 21.*degC"),
        (lambda d: d.assign(room=d["room"] + 273.15), MAPPING, "variables.warmth.*is it in K"),
        (lambda d: d.assign(room=21.0), MAPPING, r"variables.warmth: column 'room': every reading is 294.15 K"),
        (lambda d: d.assign(sun=7.0), MAPPING, "weather.ghi: column 'sun': every reading is 7"),
        (lambda d: d.iloc[:100], MAPPING, "spans 16.5 h; expected at least a day"),
        (lambda d: d.iloc[::-1], MAPPING, "runs backwards from row 1"),
        (lambda d: d.drop(columns="room"), MAPPING, "has no column 'room'; found room 2"),
        (lambda d: d.drop(columns="when"), MAPPING, "time.column: .*has no column 'when'"),
        (lambda d: d.assign(room="warm"), MAPPING, "holds text such as 'warm'"),
        (lambda d: d.assign(room=np.nan), MAPPING, "column 'room' of .* is empty"),
        (
            lambda d: d.assign(outside=d["outside"].where(d.index % 60 < 30)),
            MAPPING,
            "longest stretch in which no inputs are missing .*outdoors in",
        ),
        (None, MAPPING.replace("Europe/Amsterdam", "Mars/Olympus"), "zone is 'Mars/Olympus'"),
        (None, MAPPING.replace("variables.gas", "variables.gaz"), "'gaz' is neither output nor input of House"),
        (None, MAPPING.replace("weather.ghi", "weather.sunny"), "'sunny' is not known"),
        (None, MAPPING.replace('"kW"', '"degC"'), "variables.gas.*'degC' cannot become 'W'"),
        (None, MAPPING.replace("persons = 2.0\n", ""), "unit is presence but persons is missing"),
        (None, MAPPING.replace("[place]\nlatitude = 52.0\nlongitude = 5.0", ""), "place is missing"),
        (None, MAPPING.replace("schema_version = 1", ""), "schema_version: missing"),
        (None, MAPPING.replace("scale = 2.4", "skale = 2.4"), "variables.air.skale: unknown field"),
        (None, MAPPING + "[", "not valid TOML"),
        (None, MAPPING.replace('system = "house.toml"', ""), "system is missing"),
        (
            None,
            MAPPING.replace('"Europe/Amsterdam"', '"Europe/Amsterdam"\nformat = "unix"'),
            "not a time of format 'unix'",
        ),
    ],
)
def test_each_fault_is_a_sentence_and_no_file(house, tmp_path, change, mapping, said):
    frame, _ = measured(days=3)
    with pytest.raises(RecordingError, match=said) as caught:
        house(frame if change is None else change(frame), mapping)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_to(house, tmp_path):
    (tmp_path / "out").write_text("a file, not a folder")
    with pytest.raises(RecordingError, match="cannot be written"):
        house(measured(days=2)[0])
    with pytest.raises(RecordingError, match=r"ending is '.csv'; expected .nc"):
        house(measured(days=2)[0], out="house.csv")


def test_an_import_again_gives_the_same(house):
    frame, _ = measured(days=2)
    first = Path(house(frame).recording).read_bytes()
    assert Path(house(frame).recording).read_bytes() == first


def test_other_dialects(house, tmp_path):
    """Semicolons, decimal commas, lines before the header, Excel's dates: the same recording."""
    frame, _ = measured(days=2)
    plain = xr.load_dataset(house(frame).recording)
    frame["when"] = pd.to_datetime(frame["when"]).dt.strftime("%d-%m-%Y %H:%M")
    text = "exported by a logger\n" + frame.to_csv(index=False, sep=";", decimal=",")
    (tmp_path / "data.csv").write_text(text)
    mapping = MAPPING.replace(
        "[time]", '[file]\nseparator = ";"\ndecimal = ","\nskip = 1\n[time]\nformat = "%d-%m-%Y %H:%M"'
    )
    (tmp_path / "mapping.toml").write_text(mapping)
    report = import_recording(tmp_path / "mapping.toml", tmp_path / "data.csv", out=tmp_path / "other.nc")
    other = xr.load_dataset(report.recording)
    xr.testing.assert_allclose(plain["warmth"], other["warmth"])
    xr.testing.assert_allclose(plain["sunshine"], other["sunshine"])


def test_a_cf_checker_accepts_a_recording(house):
    pytest.importorskip("compliance_checker.runner")
    from compliance_checker.suite import CheckSuite

    report = house(measured(days=2)[0])
    CheckSuite.load_all_available_checkers()
    suite = CheckSuite()
    groups, errors = suite.run_all(suite.load_dataset(report.recording), ["cf:1.11"], skip_checks=[])["cf:1.11"]
    assert not errors
    wrong = {message for group in groups for message in group.msgs if group.value[0] < group.value[1]}
    assert not wrong, wrong


def test_the_picture_shows_what_was_left_out(house):
    """A stuck stretch is drawn in red, a missing one in grey."""
    frame, hours = measured()
    clean = imread(house(frame).picture)
    frame.loc[(hours >= 60) & (hours <= 75), "room"] = 20.25
    marked = imread(house(frame).picture)
    red = [float(((p[..., 0] > 0.7) & (p[..., 1] < 0.3) & (p[..., 2] < 0.2)).sum()) for p in (clean, marked)]
    assert clean.shape[0] > 900 and red[0] == 0 and red[1] > 50


OFFICE_ROWS = {
    "timestamp": None,
    "bms_temp_in__degC": lambda h: 21 + np.sin(2 * np.pi * h / 24),
    "meter_temp_in__degC": lambda h: 19 + np.sin(2 * np.pi * h / 24),
    "bms_co2__ppm": lambda h: 450 + 300 * ((h % 24 > 9) & (h % 24 < 17)) * (1 - np.exp(-(h % 24 - 9) / 2)),
    "meter_co2__ppm": lambda h: 480 + 10 * np.sin(h),
    "bms_occupancy__bool": lambda h: ((h % 24 > 9) & (h % 24 < 17)).astype(float),
    "bms_valve_frac__0": lambda h: 0.2 + 0.6 * ((h % 24 > 9) & (h % 24 < 17)),
    "temp_out__degC": lambda h: 8 + 3 * np.sin(2 * np.pi * h / 24),
    "wind__m_s_1": lambda h: 3 + np.sin(h),
    "ghi__W_m_2": lambda h: np.maximum(300 * np.sin(2 * np.pi * (h % 24 - 7) / 20), 0) * (h % 24 < 17),
}


def test_the_example_runs_from_csv_to_residuals(tmp_path):
    """The office's own mapping on data of its shape, made here; its FMU in replay with a plausible room."""
    first = datetime(2022, 10, 27, 22, 0, tzinfo=UTC)
    hours = np.arange(0, 6 * 24, 0.25)
    frame = pd.DataFrame({k: f(hours) for k, f in OFFICE_ROWS.items() if f is not None})
    frame.insert(0, "timestamp", [(first + timedelta(hours=h)).astimezone(ZONE).isoformat(sep=" ") for h in hours])
    frame.to_csv(tmp_path / "office.csv", index=False)
    report = import_recording(
        OFFICE.with_name("office-import.toml"), tmp_path / "office.csv", out=tmp_path / "office.nc"
    )
    system = load_system(OFFICE)
    assert report.not_recorded == []
    record = read_recording(report.recording, system)
    assert record.step == 900.0 and set(record.inputs) == set(system.input_names)
    assert record.inputs["mOA_in"].max() == pytest.approx(0.8 * 240 * 1.2 / 3600, rel=1e-6)
    middle = {p.name: float(np.sqrt(p.min * p.max)) for p in system.parameters}
    found = residuals(system, report.recording, parameters=middle, replay=True)["outputs"]
    assert found["TRoo"]["rmse"] < 15 and found["CO2"]["rmse"] < 500
    # the room's air answers to the measured flow: more of it, less CO2
    few = residuals(system, report.recording, parameters={**middle, "gaiCO2.k": 4e-6}, replay=True)["outputs"]
    assert few["CO2"]["bias"] > found["CO2"]["bias"]


def test_the_command(tmp_path, capsys):
    (tmp_path / "house.toml").write_text(HOUSE)
    (tmp_path / "mapping.toml").write_text(MAPPING)
    measured(days=2)[0].to_csv(tmp_path / "data.csv", index=False)
    app = new_app("diagnosis", "")
    app.command(import_, name="import")
    words = ["import", str(tmp_path / "mapping.toml"), str(tmp_path / "data.csv"), "--out", str(tmp_path / "out.nc")]
    assert start(app, words) == OK
    said = capsys.readouterr().out
    assert "UTC+1 h" in said and "columns not used: not mapped" in said and "second meter (room 2): +0.5 K" in said
    assert start(app, [*words, "--json"]) == OK
    assert json.loads(capsys.readouterr().out)["step"] == 1800.0
    assert start(app, [*words[:2], str(tmp_path / "none.csv"), *words[3:]]) == FAULT
    assert "none.csv: no such file" in capsys.readouterr().err


def test_the_package_is_light_to_import():
    code = "import diagnosis.importing, sys; sys.exit('pint' in sys.modules or 'matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=os.environ, check=False).returncode == 0
