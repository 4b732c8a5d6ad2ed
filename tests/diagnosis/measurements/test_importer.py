"""A CSV with all that goes wrong in measurements becomes a recording."""

import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.image import imread

from diagnosis.measurements.importer import import_recording
from diagnosis.recording import read_recording
from shared.errors import RecordingError
from shared.schema import ASSUMED, COMPUTED, EPOCH, IMPOSSIBLE, INTERPOLATED, MISSING, PARTLY, STUCK
from shared.system import load_system
from tests.diagnosis.measurements.house_cases import MAPPING, measured, warmth


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
    np.testing.assert_allclose(data["outdoors"], 281.15 + 3 * np.sin(2 * np.pi * hours / 24), atol=4e-3)
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


def test_an_input_that_stays_missing_parts_the_recording(house):
    """Nothing is cut: rows are lost for 7 h, and so are the steps from 48.5 to 54.5 h, with days on both sides."""
    frame, hours = measured()
    frame.loc[(hours > 48) & (hours < 55), "outside"] = np.nan
    report = house(frame)
    data, at = steps_of(report)
    assert at[0] == pytest.approx(0.5, abs=0.6) and at[-1] == pytest.approx(144.0, abs=0.6)
    lost = np.isnan(data["outdoors"].values)
    assert lost.sum() == 13 and ((at[lost] > 48) & (at[lost] < 55)).all()
    np.testing.assert_allclose([one.hours for one in report.stretches], [48.0, 89.5], atol=0.6)
    assert report.measured == pytest.approx(144.0, abs=0.6)
    assert sum(one.measured for one in report.stretches) == pytest.approx(report.measured - 6.5, abs=0.01)
    told = [note for note in report.notes if "fill_up_to" in note]  # less than 5 % of the hours: not worth a line
    assert told == [] and any("2 stretches" in note for note in report.notes)


@pytest.mark.parametrize(
    ("lose", "line", "key"),
    [
        (lambda d, h: d["outside"].where((h < 60) | (h > 70)), 'fill = "interpolate" with fill_up_to = ', "temp_air"),
        (lambda d, h: d["outside"].where((h < 60) | (h > 90), 8.0), "stuck_after = 0.0", "temp_air"),
        (lambda d, h: d["outside"].where((h < 60) | (h > 90), -60.0 - h / 90), r"valid = \[", "temp_air"),
    ],
)
def test_the_line_that_is_named_keeps_what_was_lost(house, lose, line, key):
    frame, hours = measured()
    frame["outside"] = lose(frame, hours)
    report = house(frame)
    assert len(report.stretches) == 2
    (said,) = {one[1] for note in report.notes if (one := re.search(rf"({line}.*?) under \[weather.{key}\]", note))}
    lines = said.replace(" with ", "\n")
    kept = house(frame, MAPPING.replace('column = "outside"\n', f'column = "outside"\n{lines}\n'))
    assert len(kept.stretches) == 1 and sum(one.measured for one in kept.stretches) > report.measured - 1.1
    assert not any("stretches" in note or "are left out" in note for note in kept.notes)


def test_what_comes_after_the_last_reading_is_kept_for_a_forecast_or_told(house):
    frame, hours = measured()
    outputs = [one for one in ("room", "room 2", "kilowatts") if one in frame]
    frame.loc[hours > 96, outputs] = np.nan
    report = house(frame)
    _, at = steps_of(report)
    assert at[-1] == pytest.approx(96.0, abs=0.6)
    assert any(f"inputs go on for {96} steps after the last" in note and "--ahead" in note for note in report.notes)
    report = house(frame, ahead=True)
    data, at = steps_of(report)
    assert at[-1] == pytest.approx(144.0, abs=0.6)
    assert np.isnan(data["warmth"].values[at > 97]).all() and np.isfinite(data["outdoors"].values).all()
    assert any("are kept for a forecast" in note for note in report.notes)


def test_what_is_not_mapped_is_said(house):
    mapping = MAPPING.replace("[variables.people]", "[weather.opaque_cover]").replace("persons = 2.0\n", "")
    mapping = mapping.replace('unit = "presence"\n', 'unit = "fraction"\n')
    report = house(
        measured()[0], mapping.replace('[variables.air]\ncolumn = "valve"', "[variables.air]\nconstant = 50.0")
    )
    assert report.not_recorded == ["people"]
    assert report.lacking == ["occupants were not counted (people): fits treat them as unknown"]
    assert any("measured cloud cover" in note for note in report.notes)
    data, _ = steps_of(report)
    np.testing.assert_allclose(data["air"], 0.04, rtol=1e-6)
    assert "people" not in data


def test_an_import_again_gives_the_same(house):
    frame, _ = measured(days=2)
    first = Path(house(frame).recording).read_bytes()
    assert Path(house(frame).recording).read_bytes() == first


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


@pytest.mark.parametrize(("step", "hours"), [(1800.0, 3.0), (7200.0, 2.0)])
def test_no_gap_is_filled_that_is_longer_than_the_mapping_allows(house, step, hours):
    """Of steps of two hours one is bridged in three hours, not two."""
    frame, elapsed = measured()
    for first, long in ((49.0, hours), (97.0, hours + step / 3600)):  # the first row is of 23:00 standard time
        frame.loc[(elapsed > first) & (elapsed <= first + long), "valve"] = np.nan
    mapping = MAPPING.replace("[place]", f"[grid]\nstep = {step}\n[place]")
    report = house(frame, mapping.replace("fill = 0.0", 'fill = "interpolate"\nfill_up_to = 3.0'))
    assert next(one for one in report.variables if one.name == "air").interpolated == round(hours * 3600 / step)
    assert report.stretches[0].end == "2022-11-01 00:00"  # the second gap, a step longer, parts the recording


def test_a_logger_that_writes_a_row_for_each_sensor_loses_none(house):
    """Two rows of every time stamp, each with some of the columns: the same recording as of whole rows."""
    frame, _ = measured()
    whole = xr.load_dataset(house(frame, out="whole.nc").recording)
    half = [name for name in frame.columns if name != "when"][::2]
    apart = pd.concat([frame.drop(columns=half), frame[["when", *half]]]).sort_index(kind="stable")
    report = house(apart, out="apart.nc")
    xr.testing.assert_equal(xr.load_dataset(report.recording), whole)
    assert any("the first reading of each column is used" in note for note in report.notes)


def test_facts_of_the_building_come_along_by_the_names_of_the_description(tmp_path):
    example = Path(__file__).resolve().parents[3] / "docs" / "example"
    mapping = tmp_path / "mapping.toml"
    mapping.write_text((example / "mapping.toml").read_text() + '\n[given]\n"window.share" = 0.3\n')
    more = {"system": "Room", "out": tmp_path / "room.nc"}
    import_recording(mapping, example / "measurements.csv", **more)
    assert read_recording(tmp_path / "room.nc", load_system("Room")).given == {"window.share": 0.3}
    text = mapping.read_text()
    mapping.write_text(text + "azimuth = 90.0\n")
    room = load_system("Room")
    east = room.model_copy(update={"weather": room.weather.model_copy(update={"surface_azimuth": 90.0})})
    import_recording(mapping, example / "measurements.csv", **more)
    turned = xr.load_dataset(tmp_path / "room.nc")
    mapping.write_text(text.replace("0.3", "30.0"))
    report = import_recording(mapping, example / "measurements.csv", system=east, out=tmp_path / "east.nc")
    np.testing.assert_array_equal(turned["HFac"], xr.load_dataset(tmp_path / "east.nc")["HFac"])
    assert any("given window.share is 30, and the description has 0.05 to 0.8" in one for one in report.notes)
    mapping.write_text(text.replace("window.share", "window.shade"))
    with pytest.raises(RecordingError, match=r"given: 'window.shade' is no given fact of Room; found .*window\.share"):
        import_recording(mapping, example / "measurements.csv", **more)


def test_all_mistakes_are_told_in_one_go(house):
    """Of the mapping against the system, of the file's columns, and then of what stands in the columns."""
    frame, _ = measured()
    wrong = MAPPING.replace('unit = "degC"\ncompare', 'unit = "ppm"\ncompare').replace('"kilowatts"', '"kilowatt"')
    with pytest.raises(RecordingError) as told:
        house(frame, wrong)
    assert "cannot become" in str(told.value) and "did you mean kilowatts?" in str(told.value)
    with pytest.raises(RecordingError) as told:
        house(frame.assign(room="lost", kilowatts="lost"))
    assert all(f"column '{name}'" in str(told.value) for name in ("room", "kilowatts"))
