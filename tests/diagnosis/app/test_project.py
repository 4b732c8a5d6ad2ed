"""The page's state without a page: a folder of files, each of which the commands read as well."""

import re
import time
import tomllib

import numpy as np
import pandas as pd
import psutil
import pytest
import xarray as xr

from diagnosis.app.job import Job
from diagnosis.app.project import MOST, Project, as_toml, combined
from diagnosis.cli import app
from shared.console import OK, start
from shared.errors import RecordingError
from shared.system import load_system
from tests.conftest import ROOT

LOG = ROOT / "docs" / "example" / "measurements.csv"
GIVEN = {"time.zone": "America/New_York", "place.latitude": "36.1", "place.longitude": "-79,95"}


@pytest.fixture
def project(tmp_path, monkeypatch):
    """With a week of the example's log; drawing it takes most of an import's time."""
    monkeypatch.setattr("diagnosis.measurements.importer.draw_recording", lambda *_: b"no picture")
    made = Project(tmp_path / "room", "MixedAirCO2")
    made.receive(r"C:\logs\..\week.csv", b"".join(LOG.read_bytes().splitlines(keepends=True)[:170]))
    return made


def test_a_log_becomes_the_recording_that_the_command_makes_of_the_same_files(project, tmp_path, monkeypatch):
    look = project.look()
    assert {one.name: one.to for one in look.columns}["room_degC"] == "variables.TRoo"
    assert look.open == ["time.zone", "place.latitude", "place.longitude"]
    project.choose(look, look.columns, GIVEN)
    report = project.make_recording()
    line = next(one for one in project.commands().splitlines() if " import " in one)
    words = line.replace("recording.nc", str(tmp_path / "other.nc")).split()[1:]
    monkeypatch.chdir(project.folder)
    assert start(app, words) == OK
    with xr.open_dataset(project.recording) as one, xr.open_dataset(tmp_path / "other.nc") as other:
        xr.testing.assert_equal(one, other)
    again = Project(project.folder, "MixedAirCO2")  # a page that is loaded again
    assert again.imported == report
    assert again.look().mapping["place"]["longitude"] == -79.95


def test_what_physics_says_stands_at_the_column_that_it_is_about(project):
    low = pd.read_csv(project.data)
    low["co2_ppm"] -= 110
    project.receive("low.csv", low.to_csv(index=False).encode())
    look = project.look()
    project.choose(look, look.columns, GIVEN)
    said = project.said_of(project.make_recording())
    text, strong = said["co2_ppm"][0]
    assert strong and "offset" in text
    assert not any(hard for _, hard in said.get("room_degC", []))


def test_a_choice_that_cannot_be_is_refused_and_nothing_is_written(project):
    look = project.look()
    twice = [*look.columns[:1], *(one.__class__(**{**vars(one), "to": "variables.TRoo"}) for one in look.columns[1:2])]
    for columns, given, said in [
        (twice, GIVEN, "both TRoo"),
        (look.columns, {**GIVEN, "time.zone": " "}, "time.zone: is empty.*Europe/Berlin"),
        (look.columns, {**GIVEN, "place.latitude": "north"}, "place.latitude: is 'north'; expected a number"),
    ]:
        with pytest.raises(RecordingError, match=said):
            project.choose(look, columns, given)
    assert not project.mapping.exists()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("log.exe", b"x", "ending is '.exe'; expected one of .csv"),
        ("log.csv", b"", "is empty"),
        ("log.csv", bytes(MOST + 1), "expected at most 256 MiB"),
    ],
)
def test_what_is_no_file_of_measurements_is_refused(tmp_path, name, content, said):
    project = Project(tmp_path / "room", "MixedAirCO2")
    with pytest.raises(RecordingError, match=said):
        project.receive(name, content)
    assert project.data is None


def test_a_file_never_leaves_the_folder_and_takes_no_name_of_the_project(tmp_path):
    project = Project(tmp_path / "room", "MixedAirCO2")
    for name in ("../../recording.nc", "..\\recording.nc"):
        assert project.receive(name, b"x") == project.folder / "measurements.nc"


def test_a_known_area_is_a_constant_of_the_room_and_everything_else_stays(project):
    project.know({"roo.AFlo": "98.4", "surface_azimuth": "90", "roo.V": ""}, replay=False)
    room, described = load_system(project.room), project.described
    assert room.fixed == {"roo.AFlo": 98.4}
    assert room.parameter_names == [one for one in described.parameter_names if one != "roo.AFlo"]
    assert room.weather.surface_azimuth == 90.0
    assert room.fmu_path == described.fmu_path
    assert room.effects == described.effects
    assert project.asked("calibration")["system"] == "room.toml"
    assert "run" not in project.asked("calibration")  # the estimator is of another system
    project.know({}, replay=True)
    assert not project.room.exists()
    assert project.asked("diagnosis")["replay"] is True


def test_a_given_fact_sets_what_the_description_says_it_does(tmp_path):
    project = Project(tmp_path / "room", "Room")
    project.know({"heater.size": "2500", "roo.AFlo": "20"}, replay=False)
    room = load_system(project.room)
    assert room.fixed == {"roo.AFlo": 20.0, "QHea_max": 2500.0}
    assert "heater.size" not in [one.name for one in room.given]
    cooler = next(one for one in room.given if one.name == "cooler.size")
    assert (cooler.per, cooler.min, cooler.max) == ("", 400.0, 4000.0)  # 20 to 200 W/m2
    assert not [one for one in room.ratios if "roo.AFlo" in (one.over, one.under)]


def test_a_table_is_the_same_after_it_was_written_as_toml(default_system):
    raw = default_system.model_dump(mode="json", exclude={"path"}, exclude_none=True)
    raw["odd"] = {'a "b"\n': "c\\d\x7f", "numbers": [1.5, -2, True, 1e-30], "in": {"deep": [{"x": 1}]}}
    assert tomllib.loads(as_toml(raw)) == raw


def test_a_step_is_stopped_within_two_seconds_leaves_no_process_and_goes_on_to_its_answer(
    house, house_recording, tmp_path
):
    """A house of two resistances, whose recording another program made exactly."""
    project = Project(tmp_path / "project", house().path)
    house_recording(hours=36).rename(project.recording)
    job = Job(project, "calibration")
    deadline = time.monotonic() + 60
    while "fitting" not in job.stage and time.monotonic() < deadline:
        time.sleep(0.05)
    family = [job._process.pid, *(one.pid for one in psutil.Process(job._process.pid).children(recursive=True))]
    begin = time.monotonic()
    job.stop()
    assert time.monotonic() - begin < 2.0
    assert not job.running and job.stopped and not job.error
    assert not [one for one in family if psutil.pid_exists(one)]
    assert not project.done("calibration")
    with pytest.raises(RecordingError, match="has no answer yet"):
        combined(project)
    job = Job(project, "calibration")
    while job.running:
        time.sleep(0.05)
    assert job.error == ""
    with xr.open_dataset(project.folder / "calibration" / "curves.nc") as curves:
        left = curves["measured"] - curves["model"]
        assert float(np.sqrt((left**2).mean())) < 0.1  # its noise is 0.05 K
    page = combined(project)
    assert page.count("</head><body>") == 1 and "data:image/png" in page
    assert not re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=.(?!data:)", page) and "Bokeh.set_log_level" in page
