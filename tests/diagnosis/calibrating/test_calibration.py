"""Calibrations of a second system, by command and function, and what a recording cannot be."""

import json
import re
from copy import copy
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from diagnosis import residuals
from diagnosis.calibrating.calibration import calibrate
from diagnosis.calibrating.report import sentences, write_calibration
from diagnosis.calibrating.schema import _explained, read_calibration, summarise
from diagnosis.cli import app
from diagnosis.recording import read_recording
from shared.console import FAULT, OK, start
from shared.errors import RecordingError, SystemDescriptionError
from shared.stretches import Stretch
from tests.conftest import ROOT
from tests.diagnosis.conftest import TRUTH, WARM_UP


def changed(path, change):
    data = xr.load_dataset(path, decode_times=False)
    out = change(data)
    bad = path.with_name("bad.nc")
    (out if isinstance(out, xr.Dataset) else data).to_netcdf(bad)
    return bad


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["room"].values.__iadd__(273.15), "declared in degC but is.*look like K"),
        (lambda d: d["room"].values.fill(20.0), "'room' is 20 degC throughout"),
        (lambda d: d.isel(time=slice(0, 20)), "20 h long; expected at least a day"),
        (lambda d: d.drop_vars("room"), "none of the outputs room"),
    ],
)
def test_each_fault_is_a_sentence_and_nothing_is_written(house, house_recording, tmp_path, change, said, capsys):
    bad = changed(house_recording(hours=72), change)
    out = tmp_path / "out"
    with pytest.raises(RecordingError, match=said):
        calibrate(house("me"), bad, out=out)
    assert start(app, ["calibrate", str(house("me").path), str(bad), "--out", str(out)]) == FAULT
    assert not out.exists()
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace('name = "ro"', 'name = "roo.V"'), "'roo.V'"),
        (lambda text: text.replace('name = "S"', 'name = "HFac"'), "'HFac'"),
    ],
)
def test_a_description_whose_variables_the_fmu_lacks(house, house_recording, tmp_path, change, said, capsys):
    """Parameters, outputs and inputs of another FMU: the missing one is named, and nothing is written."""
    own = house("me").path
    wrong = own.with_name("another.toml")
    wrong.write_text(change(own.read_text(encoding="utf-8")), encoding="utf-8")
    recording = house_recording(hours=48)
    data = xr.load_dataset(recording).rename({"S": "HFac"}) if "HFac" in said else xr.load_dataset(recording)
    data.to_netcdf(tmp_path / "renamed.nc")
    with pytest.raises(SystemDescriptionError, match=said):
        calibrate(wrong, tmp_path / "renamed.nc")
    out = tmp_path / "out"
    assert start(app, ["calibrate", str(wrong), str(tmp_path / "renamed.nc"), "--out", str(out)]) == FAULT
    assert not out.exists()
    told = capsys.readouterr().err
    assert said.strip("'") in told and "Traceback" not in told


@pytest.mark.parametrize(
    ("change", "options", "said"),
    [
        (
            lambda d: d.drop_vars("N"),
            {"occupancy": "measured"},
            "N was not recorded; expected it, or occupancy unknown",
        ),
        (lambda d: d.drop_vars("P"), {"replay": True}, "'P'.* was not recorded; replay needs it"),
        (
            lambda d: d["S"].values.__setitem__(slice(None, None, 20), np.nan),
            {},
            r"longest stretch without gaps has 19 h \(S in 3 of 48 steps have no value\); without S there would be one",
        ),
    ],
)
def test_what_a_calibration_needs_is_named(house, house_recording, change, options, said):
    with pytest.raises(RecordingError, match=said):
        calibrate(house("me"), changed(house_recording(hours=48), change), **options)


def test_a_file_that_is_no_calibration_is_told(tmp_path):
    with pytest.raises(RecordingError, match="no such file; expected a file of `diagnosis calibrate`"):
        read_calibration(tmp_path)
    (tmp_path / "calibration.json").write_text('{"z": [1.0]}')
    with pytest.raises(RecordingError, match="expected a file of `diagnosis calibrate`"):
        read_calibration(tmp_path)
    (tmp_path / "calibration.json").write_text('{"schema_version": 7}')
    with pytest.raises(RecordingError, match=r"is 7, .* temperature's range .*; expected 8, .*: calibrate again"):
        read_calibration(tmp_path)
    (tmp_path / "calibration.json").write_text('{"schema_version": 9, "tricks": "new"}')
    with pytest.raises(RecordingError, match=r"schema version is 9; .* reads up to 8: update it"):
        read_calibration(tmp_path)


@pytest.mark.slow
def test_the_command_writes_figures_and_a_page(house, house_recording, tmp_path, capsys):
    out = tmp_path / "made" / "here"
    recording = house_recording(hours=120)
    words = ["calibrate", str(house("me").path), str(recording), "--out", str(out), "--starts", "1"]
    words += ["--warm-up", str(WARM_UP), "--json"]
    assert start(app, words) == OK
    said = json.loads(capsys.readouterr().out)
    assert sorted(one.name for one in out.iterdir()) == ["calibration.html", "calibration.json"]
    assert list(out.parent.iterdir()) == [out]
    report = read_calibration(out)
    assert said == report.model_dump(mode="json")
    assert report.occupancy == "measured"
    for name, true in TRUTH.items():
        one = report.parameter(name)
        assert one.prior_min <= one.low < one.value < one.high <= one.prior_max
        assert abs(np.log(one.value / true)) < 4 * abs(np.log(one.high / one.low)) / 3.29
    page = (out / "calibration.html").read_text()
    assert "Times are of standard time, also in summer." in page and "are not drawn" not in page
    assert page.count("data:image/png;base64,") == 3 and "Bokeh.embed" in page
    assert all(name in page for name in TRUTH)
    without = re.sub("<script.*?</script>", "", page, flags=re.DOTALL)
    assert "http" not in without.replace("http-equiv", "")


def test_a_recording_counts_for_less_than_the_fit_believes_and_the_page_says_so(calibrated):
    """Each parameter's information is divided by the doubt squared; the prior's, which is one, is not."""
    doubt = json.loads((ROOT / "fmus" / "MixedAirCO2" / "verdict.json").read_text())["doubt"]
    assert (calibrated.report.widened, calibrated.report.started_from) == (doubt, "prior")
    stated = np.array(calibrated.report.covariance)
    np.testing.assert_allclose(np.diag(stated), 1 / (1 + (calibrated.fit.sd**-2 - 1) / doubt**2), rtol=1e-6)
    np.linalg.cholesky(stated)
    low, high = (
        calibrated.problem.unknowns({one.name: getattr(one, end) for one in calibrated.report.parameters})
        for end in ("low", "high")
    )
    inside = [k for k, one in enumerate(calibrated.report.parameters) if not one.at_bound]
    np.testing.assert_allclose((high - low)[inside], 2 * 1.645 * np.sqrt(np.diag(stated))[inside], rtol=1e-3)
    assert inside
    problem = copy(calibrated.fit.problem)
    problem.replay = True
    report = summarise(replace(calibrated.fit, problem=problem), {}, 1.5)
    said = " ".join(sentences(report))
    assert "Intervals are up to 1.5 times as wide" in said and "Actuators were replayed" in said
    said = " ".join(sentences(report.model_copy(update={"occupancy": "unknown"})))
    assert "Occupants were not counted" in said and "Actuators were replayed" in said
    assert report.undeclared == {} and "No noise is declared" not in said
    said = " ".join(sentences(report.model_copy(update={"undeclared": {"room": "0.01 degC"}})))
    assert "No noise is declared for the sensor of room (to 0.01 degC): " in said and "as noise.sensor, or" in said


@pytest.mark.parametrize(
    ("followed", "missed", "invented", "share"),
    [
        (0, 0, 0, None),  # a flow at its minimum, followed to the sensor's noise: 1 - mse / var would be nought
        (0, 0, 9, 1 - 81 / 3),  # a model that moves where the building does not
        (5, 0, 0, 1.0),
        (3, 4, 0, 9 / 25),
    ],
)
def test_the_share_that_is_explained_is_of_what_exceeds_the_sensors_noise(followed, missed, invented, share):
    """Sines of given standard deviations, orthogonal; that of the noise is one."""
    step = 2 * np.pi * np.arange(4000) / 4000
    noise, signal, error = (np.sqrt(2) * np.sin(k * step) for k in (7, 2, 3))
    found = _explained(20 + followed * signal + missed * error + noise, 20 + followed * signal + invented * error, 1.0)
    assert found is None if share is None else found == pytest.approx(share, abs=1e-6)


def test_a_stretch_is_calibrated_as_a_recording_of_it_alone(house, house_recording, tmp_path):
    """The sun of six hours is lost: of 48 h and 36 h each is taken by number, the longer one by default."""
    data = xr.load_dataset(house_recording(hours=90), decode_times=False)
    data["S"].values[48:54] = np.nan
    path, alone = tmp_path / "lost.nc", tmp_path / "alone.nc"
    data.to_netcdf(path)
    data.isel(time=slice(54, None)).to_netcdf(alone)
    second = calibrate(house("me"), path, stretch=Stretch(2), starts=1, warm_up=WARM_UP)
    expected = calibrate(house("me"), alone, starts=1, warm_up=WARM_UP)
    assert second.report.parameters == expected.report.parameters
    assert second.report.days == expected.report.days
    record = read_recording(path, house("me"))
    assert len(record.time) == 48
    with pytest.raises(RecordingError, match="stretch is given with a recording that has been read"):
        calibrate(house("me"), record, stretch=Stretch(2))


def test_residuals_with_a_calibration_are_its_own_figures_and_carry_to_days_that_it_has_not_seen(
    calibrated, house, house_recorded, tmp_path, capsys
):
    system, report = house("me"), calibrated.report
    write_calibration(calibrated, tmp_path)
    words = ["residuals", str(system.path), report.recording, "--calibration", str(tmp_path)]
    words += ["--warm-up", str(WARM_UP), "--json"]
    assert start(app, words) == OK
    found = json.loads(capsys.readouterr().out)
    assert found["parameters"] == {one.name: one.value for one in report.parameters}
    assert found["outputs"]["room"]["rmse"] == pytest.approx(report.outputs["room"].rmse, rel=2e-3)
    other = house_recorded(tmp_path, hours=48, seed=1)
    left = residuals(system, other, calibration=report, warm_up=WARM_UP).outputs["room"]["rmse"]
    assert left < 0.1  # of 0.05 K of noise
    middle = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
    assert residuals(system, other, parameters=middle, warm_up=WARM_UP).outputs["room"]["rmse"] > 5 * left
    assert start(app, [*words, "--set", "ro=3"]) == FAULT
    assert "calibration is given, and parameters (--set) beside it" in capsys.readouterr().err
    assert start(app, [*words, "--replay"]) == FAULT
    said = " ".join(capsys.readouterr().err.split())
    assert "simulated controllers, and here are replayed actuators; expected the same in both: leave out" in said


@pytest.mark.slow
def test_persons_whom_nobody_counted_are_as_likely_in_residuals_as_in_the_calibration(house, house_recorded, tmp_path):
    day = house_recorded(tmp_path, hours=24, count=False, persons=(np.arange(144) % 48 > 30).astype(float))
    report = calibrate(house("me"), day, starts=1, warm_up=WARM_UP, replay=True).report
    found = residuals(house("me"), day, calibration=report, warm_up=WARM_UP, replay=True)
    assert found.assumed["N"] == "what the readings make most likely"
    assert found.outputs["room"]["rmse"] == pytest.approx(report.outputs["room"].rmse, rel=0.05)
