"""Forecasts of a second system."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from datagen import simulate
from datagen.driving.occupancy import occupancy_prior
from diagnosis.calibrating.calibration import calibrate
from diagnosis.calibrating.given import check_constants
from diagnosis.calibrating.schema import read_calibration
from diagnosis.cli import app
from diagnosis.fitting.linear import Marginal
from diagnosis.fitting.problem import Problem
from diagnosis.forecasting import forecast as forecasting
from diagnosis.forecasting.forecast import band, corrected, forecast, from_the_prior
from diagnosis.forecasting.forecasted import Ahead, Forecast, about_failed
from diagnosis.forecasting.report import answer
from diagnosis.recording import read_recording
from shared.console import FAULT, OK, start
from shared.errors import RecordingError, SimulationError
from tests.conftest import ROOT
from tests.diagnosis.conftest import WARM_UP


def test_hours_that_no_reading_tells_of_have_the_persons_of_the_description(warm):
    """By the sampler itself, other draws of it: how many, how often none, and the ends of the 90 % interval."""
    problem = Problem(*warm, occupancy="unknown", known=["constants"], warm_up=86400.0)
    nuisance = problem.nuisance
    rng, level = np.random.default_rng(3), nuisance.levels[0]
    found = from_the_prior(problem, 2000, rng)
    persons = np.array([nuisance.heights(one) for one in found])[:, nuisance.guessed]
    persons = persons * rng.uniform(level.low, level.high, len(persons))[:, None]
    begin, end = (one[nuisance.guessed] for one in (nuisance.begin, nuisance.end))
    edges = np.unique(np.concatenate([begin, end]))
    expected = occupancy_prior(problem.system.occupancy, edges, 3000, seed=77)
    expected = expected[:, np.searchsorted(edges, begin)]
    assert persons.mean() == pytest.approx(expected.mean(), rel=0.06)
    np.testing.assert_allclose((persons < 0.05).mean(axis=0), (expected < 0.05).mean(axis=0), atol=0.08)
    for share in (0.05, 0.5, 0.95):
        ends = (np.quantile(one, share, axis=0) for one in (persons, expected))
        np.testing.assert_allclose(*ends, atol=0.2 * expected.max(axis=0).mean())


def test_draws_given_readings_are_those_of_the_posterior():
    """Where the prior is normal: dense algebra."""
    rng = np.random.default_rng(0)
    by, residual = rng.standard_normal((30, 8)), rng.standard_normal(30)
    marginal = Marginal(by)
    posterior = np.linalg.inv(np.eye(8) + by.T @ by)
    mean = posterior @ by.T @ residual
    draws = np.array(
        [corrected(rng.standard_normal(8), marginal.unknowns(residual), marginal, rng) for _ in range(20_000)]
    )
    np.testing.assert_allclose(draws.mean(axis=0), mean, atol=0.02)
    np.testing.assert_allclose(np.cov(draws, rowvar=False), posterior, atol=0.02)


@pytest.mark.slow
def test_houses_are_forecast_within_their_noise(house, house_recording, tmp_path):
    errors = []
    for seed in range(8):
        record = read_recording(house_recording(hours=96, seed=seed), house("me"))
        record.outputs[0, 0] = np.nan
        hours = {"context": 48, "ahead": 48, "warm_up": WARM_UP}
        done = forecast(house("me"), record, **hours, starts=1, draws=15, out=tmp_path / "ahead")
        ahead = done.report.outputs["room"]
        errors.append(ahead.rmse)
        assert ahead.covered > 0.7
    assert np.sqrt(np.mean(np.square(errors))) < 0.1  # the sensor's own noise is 0.05
    assert "Parameters from the context." in " ".join((tmp_path / "ahead" / "forecast.html").read_text().split())
    assert sorted(one.name for one in (tmp_path / "ahead").iterdir()) == ["forecast.html", "forecast.json"]


@pytest.mark.parametrize("count", [19, 20, 40])
def test_a_band_of_few_draws_holds_its_share_of_further_ones(count):
    rng = np.random.default_rng(1)
    low, high = band(rng.standard_normal((count, 60_000)))
    further = rng.standard_normal(60_000)
    assert np.mean((further > low) & (further < high)) == pytest.approx(0.9, abs=0.007)


def test_draws_that_fail_are_not_counted_among_those_of_the_band(house, house_recording, tmp_path, monkeypatch, caplog):
    """Every third of the simulations for the band does not converge."""
    asked, likely, ensemble = [], Problem.likely_nuisance, forecasting._ensemble

    def fails(self, z, around):
        asked.append(z)
        if len(asked) % 3 == 0:
            raise SimulationError("does not converge")
        return likely(self, z, around)

    def drawn(*given):
        monkeypatch.setattr(Problem, "likely_nuisance", fails)
        return ensemble(*given)

    monkeypatch.setattr(forecasting, "_ensemble", drawn)
    done = forecast(
        *(house("me"), house_recording(hours=96)),
        **{"context": 48, "ahead": 48, "starts": 1, "draws": 8, "warm_up": WARM_UP, "out": tmp_path / "ahead"},
    )
    assert (done.report.draws, done.report.failed) == (5, 3)
    said = about_failed(5, 3)
    assert said.startswith("3 of 8 simulations behind the bands failed")
    assert said in caplog.text and said in (tmp_path / "ahead" / "forecast.html").read_text()


@pytest.mark.slow
def test_a_calibration_from_a_file_has_the_bands_of_one_that_was_just_made(house, house_recording, tmp_path):
    """Readings far noisier than the description's floor: their noise is the calibration's, also from its file."""
    system, path = house("me"), house_recording(hours=96, noise=0.4)
    record = read_recording(path, system)
    inputs = {name: values[:48] for name, values in record.inputs.items()}
    first = replace(record, time=record.time[:48], outputs=record.outputs[:, :48], inputs=inputs)
    calibrate(system.with_experiment(hours=48.0), first, starts=1, warm_up=WARM_UP, out=tmp_path / "calibration")
    common = {"context": 48, "ahead": 48, "draws": 15, "warm_up": WARM_UP}
    fresh = forecast(system, path, starts=1, **common)
    again = forecast(system, path, calibration=tmp_path / "calibration", **common)
    np.testing.assert_allclose(again.high - again.low, fresh.high - fresh.low, rtol=1e-3)
    assert again.report.outputs["room"].covered > 0.8
    given = read_calibration(tmp_path / "calibration")
    other = given.model_copy(update={"fmu_sha256": "0" * 64})
    with pytest.raises(RecordingError, match=r"was made with another \S+\.fmu than there is now"):
        forecast(system, path, calibration=other, **common)
    other = given.model_copy(update={"replay": True})
    sentence = r"made with replayed actuators, and here are simulated controllers; .*: give --replay"
    with pytest.raises(RecordingError, match=sentence):
        forecast(system, path, calibration=other, **common)
    with pytest.raises(RecordingError, match=r"persons measured and 0 uncertain .* 4 unknowns; here are 5, with"):
        forecast(system, path, calibration=tmp_path / "calibration", occupancy="unknown", **common)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"context": 0, "ahead": 24}, "context is 0 h; expected more than 0"),
        ({"context": 48, "ahead": -24}, "ahead is -24 h; expected more than 0"),
        ({"context": 48, "ahead": 0.1}, "which do not divide 48.1 h"),
        (
            {"context": 48, "ahead": 24, "warm_up": 0.4},
            "warm_up is 0.4 h; .* the FMU's start values would count as known",
        ),
        ({"context": 48, "ahead": float("inf")}, "inf h are asked for; expected a step"),
        ({"context": 1e-9, "ahead": 24}, "1e-09 h are asked for; expected a step of it at least, 1 h"),
        ({"context": 48, "ahead": 24, "starts": 0}, "starts is 0; expected at least 1"),
    ],
)
def test_hours_that_are_none_are_told(house, house_recording, options, said):
    with pytest.raises(RecordingError, match=said):
        forecast(house("me"), house_recording(hours=96), **options)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--starts", "2"], "and starts beside it"),
        (["--run", "MixedAirCO2", "--starts", "1"], "and run and starts beside it"),
        (["--noise", "sensor"], "and noise beside it"),
    ],
)
def test_a_calibration_is_not_given_with_what_only_another_one_takes(tmp_path, capsys, words, said):
    """They were not looked at."""
    (tmp_path / "calibration").mkdir()
    places = ["MixedAirCO2", str(tmp_path / "r.nc"), "--out", str(tmp_path / "out")]
    assert start(app, ["forecast", *places, "--calibration", str(tmp_path / "calibration"), *words]) == FAULT
    assert f"calibration is given, {said}; expected one of both" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_replayed_actuator_that_was_not_read_ahead_is_refused(default_system, tmp_path, monkeypatch):
    """It would be bridged by a straight line from its last reading, and drive the model."""
    simulate(default_system, hours=72.0, seed=1, out=tmp_path / "room.nc")
    record = read_recording(tmp_path / "room.nc", default_system)
    outputs = record.outputs.copy()
    outputs[default_system.output_names.index("QHea"), 50:] = np.nan
    fitted = np.zeros(len(default_system.parameters))
    given = SimpleNamespace(z=fitted, covariance=[], outputs={})
    monkeypatch.setattr(forecasting, "given_calibration", lambda *_: given)
    with pytest.raises(RecordingError, match=r"'QHea' was read in 8% of the hours ahead; expected at least 95%"):
        forecast(
            default_system.model_copy(update={"uncertain": []}),
            replace(record, outputs=outputs),
            context=48.0,
            ahead=24.0,
            calibration="made before",
            replay=True,
            occupancy="measured",
        )


def test_a_house_is_forecast_in_replay_by_what_was_logged_under_its_own_name(house, house_recording):
    """It has no outputs of its actuators' columns."""
    hours = {"context": 48, "ahead": 48, "warm_up": WARM_UP}
    done = forecast(house("me"), house_recording(hours=96), **hours, starts=1, draws=5, replay=True)
    assert done.report.calibration.replayed == ["outside", "sun", "heater"]
    assert done.report.outputs["room"].rmse < 0.5


@pytest.mark.slow
def test_the_command_goes_on_from_a_calibration(house, house_recording, tmp_path):
    """It calls no fit a forecast, and its page says why not to believe it."""
    system, path = house("me"), house_recording(hours=96)
    calibrate(system, path, starts=1, warm_up=WARM_UP, out=tmp_path / "all")
    common = {"context": 48, "ahead": 48, "draws": 5, "warm_up": WARM_UP, "calibration": tmp_path / "all"}
    with pytest.raises(RecordingError, match="2001-01-03 00:00 and what follows is to be forecast, but is among"):
        forecast(system, path, **common)
    copy = tmp_path / "copy.nc"
    shutil.copy(path, copy)
    with pytest.raises(RecordingError, match=r"copy\.nc: 2001-01-03 00:00 and what follows is to be forecast"):
        forecast(system, copy, **common)
    other = house_recording(hours=72, seed=8)
    words = [str(system.path), str(other), "--context", "48", "--ahead", "24", "--out", str(tmp_path / "ahead")]
    assert start(app, ["forecast", *words, "--calibration", str(tmp_path / "all")]) == OK
    page = " ".join((tmp_path / "ahead" / "forecast.html").read_text().split())
    assert f"Parameters from a calibration on 96 h of {path.name}." in page
    doubt = json.loads((ROOT / "fmus" / "MixedAirCO2" / "verdict.json").read_text())["doubt"]
    assert f"Intervals are up to {doubt:.2g} times as wide as the fit makes them" in page
    assert page.index("Over the 24 h ahead the forecast was off in room by") < page.index("Intervals are up to")


@pytest.mark.parametrize(
    ("names", "relative", "said"),
    [
        ("ab", 0.3, None),
        ("ab", 0.1, "'a' is 1.35; the description has 'a' there"),
        ("abc", 0.3, r"has 2 uncertain constants \(a, b\), the description 3 \(a, b, c\)"),
    ],
)
def test_a_calibration_with_other_uncertain_constants_is_refused(names, relative, said):
    """They are no part of the description's hash, and the unknowns stand for what the description says they are."""
    z = np.array([1.0, -0.5])
    told = [SimpleNamespace(name=name, factor=np.exp(0.3 * one)) for name, one in zip("ab", z, strict=True)]
    problem = SimpleNamespace(
        values=lambda z: np.exp(relative * z),
        constants=[SimpleNamespace(name=name) for name in names],
        unknown=SimpleNamespace(places_of_constants=range(2)),
    )
    if said is None:
        check_constants(SimpleNamespace(constants=told), problem, z)
        return
    with pytest.raises(RecordingError, match=said):
        check_constants(SimpleNamespace(constants=told), problem, z)


def ahead(rmse, covered, unit="K"):
    return Ahead.model_construct(rmse=rmse, covered=covered, unit=unit)


def report(outputs, failed=0):
    return Forecast.model_construct(outputs=outputs, ahead_hours=336.0, level=0.9, draws=40, failed=failed)


def test_a_forecast_says_how_far_off_it_was_and_what_its_band_held():
    names = {"TRoo": "air of the room", "CO2": ""}
    off, held = answer(report({"TRoo": ahead(0.3126, 0.874), "CO2": ahead(12.0, 1.0, "ppm"), "Q": None}), names)
    said = "air of the room (TRoo) by 0.313 K, CO2 by 12 ppm (root mean square)."
    assert off == f"Over the 336 h ahead the forecast was off in {said}"
    assert held.startswith("Its 90% band covered 87% of TRoo, 100% of CO2. It allows for")


def test_where_nothing_was_measured_ahead_none_of_it_is_claimed():
    first, failed = answer(report({"TRoo": None}, failed=3), {})
    assert "the error of the forecast is unknown" in first
    assert failed.startswith("3 of 43 simulations")
