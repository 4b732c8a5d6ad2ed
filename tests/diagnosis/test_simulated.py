"""A recording beside its simulation: nothing is left when the model is right, and what is left is measured right."""

import json

import numpy as np
import pytest
import xarray as xr

from datagen import simulate
from datagen.driving.occupancy import occupancy_prior
from diagnosis import calibrate, diagnose, forecast, residuals
from diagnosis.cli import app
from diagnosis.fitting.simulations import InProcess
from diagnosis.recording import read_recording
from shared.console import FAULT, OK, start
from shared.errors import RecordingError
from shared.given import Given

HOURS = 168.0


@pytest.fixture(scope="module")
def recording(default_system, tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "room.nc"
    simulate(default_system, hours=HOURS, seed=9, out=path)
    return path


@pytest.fixture(scope="module")
def truth(recording, default_system):
    data = xr.load_dataset(recording)
    return {name: float(data[name]) for name in default_system.parameter_names}


def test_the_true_model_leaves_little(recording, truth, default_system):
    """Hourly means of the occupancy stand for its changes within the hour, and the start is not known: that is left."""
    found = residuals(default_system, recording, parameters=truth).outputs
    assert (found["TRoo"]["cvrmse"], found["TRoo"]["nmbe"]) == (None, None)
    assert found["TRoo"]["rmse"] < 0.5
    assert found["CO2"]["rmse"] < 40
    wrong = residuals(default_system, recording, parameters={**truth, "roo.AFlo": truth["roo.AFlo"] * 0.4}).outputs
    assert wrong["TRoo"]["rmse"] > 2 * found["TRoo"]["rmse"]


def test_given_facts_that_a_recording_brings_are_those_of_the_room(default_system):
    """A room with a large window: as the recording says, as the FMU has it, and in a unit that nobody asked for."""
    share = Given(name="window.share", unit="1", min=0.75, max=0.8, parameters=["fraWin"])
    system = default_system.model_copy(update={"given": [share]})
    data = simulate(system, hours=48.0, seed=9)
    true = {name: float(data[name]) for name in system.parameter_names}
    found = residuals(system, data, parameters=true)
    assert "window.share" not in found.assumed
    other = residuals(system, data.drop_vars("window.share"), parameters=true)
    assert other.assumed["window.share"] == "not given by the recording, so the FMU's own"
    assert other.outputs["TRoo"]["rmse"] > 2 * found.outputs["TRoo"]["rmse"]
    data["window.share"].attrs["units"] = "percent"
    with pytest.raises(RecordingError, match=r"'window.share' is .* in 'percent'; expected one number in '1'"):
        residuals(system, data, parameters=true)


def test_replay_of_a_record_as_it_was_written_leaves_little(recording, truth, default_system):
    """The meters are in the record, and the inputs beside them rest at the description's values throughout."""
    resting = xr.load_dataset(recording)
    assert not resting["QHea_in"].any() and resting["QHea"].max() > 1000
    found = residuals(default_system, recording, parameters=truth, replay=True, noise="none").outputs
    assert found["QHea"]["rmse"] < 1.0
    assert found["mOA"]["rmse"] < 1e-4
    assert found["TRoo"]["rmse"] < 0.5
    assert found["CO2"]["rmse"] < 40


def test_replayed_meters_are_cleared_of_their_noise(recording, truth, default_system, tmp_path):
    """As noisy as the preset says: what the model follows is told apart from that, and the noise is left."""
    data = xr.load_dataset(recording, decode_times=False)
    data["mOA"].values[:] += 0.01 * np.random.default_rng(0).standard_normal(data.sizes["time"])
    data.to_netcdf(tmp_path / "noisy.nc")
    left = [
        residuals(default_system, tmp_path / "noisy.nc", parameters=truth, replay=True, noise=noise).outputs["mOA"]
        for noise in ("none", "sensor")
    ]
    assert left[0]["rmse"] < 0.001
    assert 0.005 < left[1]["rmse"] < 0.015


def test_what_was_not_recorded_is_the_descriptions_and_is_told(recording, truth, default_system, tmp_path, capsys):
    data = xr.load_dataset(recording, decode_times=False).drop_vars(["nPer", "excHea"])
    data.to_netcdf(tmp_path / "uncounted.nc")
    command = ["residuals", str(default_system.path), str(tmp_path / "uncounted.nc"), "--set"]
    assert start(app, [*command, *(f"{name}={value}" for name, value in truth.items())]) == OK
    told = " ".join(capsys.readouterr().out.split())
    assert "Not measured, and taken as:" in told
    assert "nPer = as many as the description expects" in told and "excHea = none" in told


def test_persons_whom_nobody_counted_are_as_many_as_the_description_expects(
    recording, truth, default_system, tmp_path, monkeypatch
):
    """On average over the recording, by other draws of the sampler itself."""
    xr.load_dataset(recording, decode_times=False).drop_vars("nPer").to_netcdf(tmp_path / "uncounted.nc")
    driven, run_all = [], InProcess.map
    monkeypatch.setattr(InProcess, "map", lambda self, runs: driven.extend(runs) or run_all(self, runs))
    residuals(default_system, tmp_path / "uncounted.nc", parameters=truth)
    record = read_recording(recording, default_system)
    edges = np.append(record.start, record.time)
    means = driven[0].inputs.means(edges)[:, default_system.input_names.index("nPer")]
    expected = occupancy_prior(default_system.occupancy, edges, 8000, seed=5).mean(axis=0)
    assert means.mean() == pytest.approx(expected.mean(), rel=0.02)
    np.testing.assert_allclose(means, expected, atol=0.1 * expected.max())


def test_inputs_that_a_simulation_lacks_are_named_at_once_with_where_to_write_them(
    recording, truth, default_system, tmp_path
):
    xr.load_dataset(recording, decode_times=False).drop_vars(["TDryBul", "HFac"]).to_netcdf(tmp_path / "bad.nc")
    said = r"TDryBul \[K\], HFac \[W/m2\]; .* mapping under \[weather.temp_air\], \[weather.poa_global\]"
    with pytest.raises(RecordingError, match=said):
        residuals(default_system, tmp_path / "bad.nc", parameters=truth)


@pytest.mark.parametrize("entry", [residuals, calibrate, diagnose])
def test_a_recording_without_warm_up_is_told_before_anything_is_simulated(
    recording, truth, default_system, monkeypatch, entry
):
    monkeypatch.setattr("datagen.simulating.simulator.Simulator.__init__", lambda *_: pytest.fail("was built"))
    given = {"parameters": truth} if entry is residuals else {}
    for hours in (0.0, -5.0, 0.5 * read_recording(recording, default_system).step / 3600, float("inf")):
        with pytest.raises(RecordingError, match=rf"warm_up is {hours:g} h; expected at least a step"):
            entry(default_system, recording, warm_up=hours, **given)


@pytest.mark.parametrize("entry", [calibrate, diagnose, forecast])
def test_no_time_at_all_is_refused_before_anything_is_read(entry):
    with pytest.raises(RecordingError, match=r"minutes is -1; expected more than 0, for example 10"):
        entry("no-system", "no-recording.nc", minutes=-1)


def test_time_must_be_regular(recording, default_system, tmp_path):
    data = xr.load_dataset(recording, decode_times=False)
    data.isel(time=[0, 1, 2, 5, 6]).to_netcdf(tmp_path / "bad.nc")
    with pytest.raises(RecordingError, match="not regular"):
        read_recording(tmp_path / "bad.nc", default_system)


def test_the_command(recording, truth, default_system, capsys):
    values = [f"{name}={value}" for name, value in truth.items()]
    assert start(app, ["residuals", str(default_system.path), str(recording), "--set", *values, "--json"]) == OK
    found = json.loads(capsys.readouterr().out)
    assert set(found["outputs"]) == set(default_system.output_names)
    assert start(app, ["residuals", str(default_system.path), str(recording), "--set", values[0]]) == FAULT
    assert "no value for" in capsys.readouterr().err
    wrong = [values[0].replace("gaiCO2.k", "gaiCO2.K"), "nothing=1"]
    assert start(app, ["residuals", str(default_system.path), str(recording), "--set", *wrong]) == FAULT
    said = " ".join(capsys.readouterr().err.split())
    assert "'gaiCO2.K' is not an estimated parameter; did you mean gaiCO2.k?" in said
    assert "'nothing' is not" in said
    assert "expected names of gaiCO2.k, roo.AFlo" in said
