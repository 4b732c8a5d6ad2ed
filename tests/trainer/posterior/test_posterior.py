"""A posterior's samples and density, its files, and its refusals."""

import json
import math
import os

import numpy as np
import pytest
import torch
import xarray as xr
from scipy import integrate

from shared.errors import EstimatorError
from shared.lock import FolderLock
from shared.store import DatasetFolder
from trainer.cli import main
from trainer.posterior import calibration, fit_posterior, load_posterior
from trainer.predicting.prediction import predict
from trainer.runs.checkpoint import load_run
from trainer.training.fitting import fit

from ..conftest import TANK, make_dataset


@pytest.fixture(scope="module")
def many_tanks(tmp_path_factory):
    return make_dataset(tmp_path_factory.mktemp("many") / "ds", systems=300, root_seed=4)


@pytest.fixture(scope="module")
def fitted(many_tanks, tmp_path_factory):
    """A ridge with a posterior; tests must not change its folder."""
    torch.set_num_threads(1)
    run = fit(many_tanks, tmp_path_factory.mktemp("posterior") / "run", model="ridge", noise="gauge", steps=5)
    fit_posterior(run, many_tanks, windows_per_system=8, epochs=3)
    return run.folder


@pytest.fixture
def own(fitted, tmp_path):
    """A copy of that folder, to be damaged at will."""
    folder = tmp_path / "run"
    folder.mkdir()
    for path in fitted.iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return folder


@pytest.fixture
def recording(many_tanks, tmp_path):
    """A day of one tank's level."""
    with xr.open_dataset(many_tanks / "shards" / "000.nc") as opened:
        opened.isel(system=4, drop=True)[["level"]].isel(time=slice(0, 48)).load().to_netcdf(tmp_path / "r.nc")
    return tmp_path / "r.nc"


def windows_of(dataset, rows, length=48):
    records = DatasetFolder(dataset).load(rows=rows)
    return records.values[:, :, :length].transpose(0, 2, 1), np.full(len(rows), records.time[0]), records.parameters


def test_samples_lie_within_the_ranges_and_near_the_truth(fitted, many_tanks):
    values, time, truth = windows_of(many_tanks, np.arange(10))
    posterior = load_posterior(load_run(fitted))
    samples = posterior.sample(values, time, 200)
    assert samples.shape == (10, 200, 2)
    assert posterior.prior.inside(samples).all()
    # noise-free readings that mean nothing are still answered within the ranges
    assert posterior.prior.inside(posterior.sample(values * 50, time, 20)).all()
    spread = posterior.prior.high - posterior.prior.low
    assert np.abs((np.median(samples, axis=1) - truth) / spread).mean() < 0.1
    assert np.std(samples, axis=1).mean(axis=0) == pytest.approx(np.zeros(2), abs=0.15 * spread.max())


def test_samples_follow_from_the_seed_alone(fitted, many_tanks):
    values, time, _ = windows_of(many_tanks, np.arange(6))
    posterior = load_posterior(load_run(fitted))
    torch.manual_seed(1)
    first = posterior.sample(values, time, 50, seed=3)
    torch.manual_seed(2)
    again = load_posterior(load_run(fitted)).sample(values, time, 50, seed=3)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, posterior.sample(values, time, 50, seed=4))
    np.testing.assert_allclose(posterior.sample(values[:2], time[:2], 50, seed=3), first[:2], rtol=1e-4)


def test_the_density_is_one_over_the_ranges(fitted, many_tanks):
    """The joint density of two parameters integrates to one, temperatures included, and falls to nothing outside."""
    values, time, _ = windows_of(many_tanks, np.array([3]))
    posterior = load_posterior(load_run(fitted))
    assert not np.allclose(posterior.flow.log_temperature.numpy(), 0)
    drain, fill = np.linspace(2, 20, 201), np.linspace(1, 4, 201)
    grid = np.stack(np.meshgrid(drain, fill, indexing="ij"), axis=-1).reshape(1, -1, 2)
    density = np.exp(posterior.log_prob(values, time, grid)).reshape(201, 201)
    total = integrate.simpson(integrate.simpson(density, x=fill), x=drain)
    assert total == pytest.approx(1, abs=0.03)
    mean = integrate.simpson(drain * integrate.simpson(density, x=fill), x=drain) / total
    samples = posterior.sample(values, time, 4000)[0, :, 0]
    assert mean == pytest.approx(samples.mean(), abs=5 * samples.std() / math.sqrt(4000) + 0.01)
    outside = posterior.log_prob(values, time, np.array([[20.1, 2.0]]))
    assert outside.tolist() == [-math.inf]


def test_test_systems_take_no_part(fitted, many_tanks):
    records = DatasetFolder(many_tanks).load([])
    card = load_posterior(load_run(fitted)).card
    halves = (set(card.fitting_systems.indices), set(card.calibration_systems.indices))
    assert halves[0] | halves[1] == set(records.of_split("validation").tolist())
    assert not halves[0] & halves[1]
    assert card.training_systems_used == 0
    assert card.seen(records).sum() == 30


def test_training_systems_are_used_only_on_demand(own, many_tanks):
    found = fit_posterior(own, many_tanks, training_systems=7, windows_per_system=2, epochs=1, overwrite=True).card
    assert found.training_systems_used == 7
    assert len(found.fitting_systems.indices) == 15 + 7
    assert not set(found.calibration_systems.indices) & set(found.fitting_systems.indices)


def test_several_lengths_and_missing_channels_have_a_say(tmp_path):
    text = TANK.replace('channels = ["level"]', 'channels = ["level", "glow"]')
    dataset = make_dataset(tmp_path / "ds", systems=60, text=text)
    run = fit(
        *(dataset, tmp_path / "run"),
        model="multiscale-transformer",
        other_contexts=[12.0],
        optional=["glow"],
        steps=3,
        options={"width": 16, "layers": 1, "heads": 2, "feedforward": 16},
    )
    assert run.card.encoding.lengths == [24, 48]
    posterior = fit_posterior(run, dataset, windows_per_system=8, epochs=2)
    assert len(posterior.card.temperatures) == 2
    assert posterior.card.context == 2 + 2 + 32 + 1 + 2
    records = DatasetFolder(dataset).load(rows=np.arange(3))
    values, time = records.values.transpose(0, 2, 1), np.zeros(3)
    lacking = values.copy()
    lacking[:, :, 1] = np.nan
    whole, short, without = (
        posterior.sample(one, time, 20) for one in (values[:, :48], values[:, :24], lacking[:, :48])
    )
    assert np.isfinite(without).all()
    assert not np.allclose(whole, short)
    assert not np.allclose(whole, without)
    with pytest.raises(EstimatorError, match="windows have 30 samples; the posterior was fitted to 24, 48"):
        posterior.sample(values[:, :30], time, 5)


def test_one_run_at_a_time_is_at_work_in_a_folder(own, many_tanks):
    quick = {"systems": 8, "windows_per_system": 2, "epochs": 1}
    before = {path.name: path.read_bytes() for path in own.iterdir()} | {".lock": b""}
    with (
        FolderLock(own),
        pytest.raises(EstimatorError, match=rf"run: another run is at it \(process {os.getpid()} on"),
    ):
        fit_posterior(own, many_tanks, **quick, overwrite=True)
    assert {path.name: path.read_bytes() for path in own.iterdir()} | {".lock": b""} == before
    found = fit_posterior(own, many_tanks, **quick, overwrite=True)  # the lock is free again
    assert len(found.card.fitting_systems.indices) == 4


def spoil(folder, name, **fields):
    path = folder / name
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))


def cut(folder):
    path = folder / "posterior.safetensors"
    path.write_bytes(path.read_bytes()[:-10])


@pytest.mark.parametrize(
    ("damage", "sentence"),
    [
        (lambda f: spoil(f, "posterior.json", estimator_sha256="f" * 64), "was fitted to the estimator ffffffffffff"),
        (lambda f: spoil(f, "posterior.json", schema_version=9), "schema version is 9; this version .* reads up to 3"),
        (lambda f: spoil(f, "posterior.json", context=3), "does not fit posterior.json"),
        (lambda f: (f / "posterior.json").write_text("{"), "posterior.json: not valid JSON"),
        (lambda f: (f / "posterior.safetensors").unlink(), "no such file; expected weights"),
        (cut, "damaged, or not the weights that posterior.json describes"),
    ],
)
def test_a_posterior_that_does_not_fit_is_refused(own, damage, sentence):
    damage(own)
    with pytest.raises(EstimatorError, match=sentence):
        load_posterior(load_run(own))


def test_wrong_arguments_are_told(own, many_tanks, tmp_path):
    with pytest.raises(EstimatorError, match="already has a posterior"):
        fit_posterior(own, many_tanks)
    with pytest.raises(EstimatorError, match="systems: is 31; expected 4 or more validation systems, and no more than"):
        fit_posterior(own, many_tanks, systems=31, overwrite=True)
    with pytest.raises(EstimatorError, match="training_systems: is 241; expected 0 to the dataset's 240"):
        fit_posterior(own, many_tanks, training_systems=241, overwrite=True)
    with pytest.raises(EstimatorError, match=r"options: .*depth"):
        fit_posterior(own, many_tanks, systems=8, options={"depth": 3}, overwrite=True)
    other = make_dataset(tmp_path / "ds", systems=20, text=TANK.replace("max = 20.0", "max = 21.0"))
    with pytest.raises(EstimatorError, match="its system is Tank"):
        fit_posterior(own, other, overwrite=True)


def test_a_new_estimator_leaves_no_posterior_behind(own, many_tanks):
    fit(many_tanks, own, model="mean", overwrite=True)
    assert load_posterior(load_run(own)) is None


def test_predictions_carry_intervals_samples_and_a_corner_plot(fitted, many_tanks, recording, tmp_path):
    found = predict(fitted, recording, samples=300, out=tmp_path / "s.nc", corner=tmp_path / "c.png")
    with xr.open_dataset(tmp_path / "s.nc") as opened:
        samples = opened.load()
    assert samples["tank.fill"].dims == ("sample",)
    assert samples["tank.fill"].attrs["units"] == "m"
    one = found.predictions[0]
    low, median, high = np.quantile(samples["tank.fill"], [0.05, 0.5, 0.95], method="weibull")
    fill = one.parameters["tank.fill"]
    assert (fill.low, fill.median, fill.high) == pytest.approx((low, median, high))
    assert one.correlation[0][1] == pytest.approx(np.corrcoef(samples["tank.drain"], samples["tank.fill"])[0, 1])
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    several = predict(fitted, many_tanks / "shards" / "000.nc", samples=50, out=tmp_path / "new" / "here" / "all.nc")
    assert len(several.predictions) == 150
    with xr.open_dataset(tmp_path / "new" / "here" / "all.nc") as opened:
        assert opened["tank.drain"].shape == (150, 50)
        assert opened["system"].values.tolist() == list(range(150))
    with pytest.raises(EstimatorError, match="has 150 systems; expected one for a corner plot"):
        predict(fitted, many_tanks / "shards" / "000.nc", samples=20, corner=tmp_path / "d.png")
    with pytest.raises(
        EstimatorError, match=r"all\.nc/more: nothing can be written there, because .*all\.nc is a file"
    ):
        predict(fitted, recording, out=tmp_path / "new" / "here" / "all.nc" / "more" / "s.nc")


def test_an_interval_of_too_few_samples_is_refused_before_anything_is_written(fitted, many_tanks, tmp_path):
    words = r"samples: is 19; expected at least 20, so that one lies beyond each end of the 90 % interval"
    with pytest.raises(EstimatorError, match=words):
        predict(fitted, many_tanks / "shards" / "000.nc", samples=19, out=tmp_path / "new" / "s.nc")
    assert not (tmp_path / "new").exists()
    with pytest.raises(EstimatorError, match=words):
        calibration(fitted, many_tanks, samples=19, out=tmp_path / "new")
    assert not (tmp_path / "new").exists()
    fewest = predict(fitted, many_tanks / "shards" / "000.nc", samples=20).predictions[0].parameters.values()
    assert all(one.low < one.median < one.high for one in fewest)


@pytest.mark.parametrize("name", ["out", "corner"])
def test_the_recording_is_not_written_over(fitted, recording, tmp_path, name):
    other = tmp_path / "link.nc"
    other.symlink_to(recording)
    before = recording.read_bytes()
    for path in (recording, other):
        with pytest.raises(EstimatorError, match=rf"{name}: is .*, the recording itself; expected another file"):
            predict(fitted, recording, samples=20, **{name: path})
    assert recording.read_bytes() == before


def test_without_a_posterior_there_are_no_samples(ridge_run, tanks, tmp_path):
    shard = tanks / "shards" / "000.nc"
    assert predict(ridge_run, shard).predictions[0].parameters["tank.fill"].median is None
    with pytest.raises(EstimatorError, match="has no posterior to draw samples from; `trainer posterior` fits one"):
        predict(ridge_run, shard, out=tmp_path / "s.nc")


def test_records_of_another_step_or_too_short_are_refused(own, tmp_path):
    """Lengths of windows are samples to a run: a day of it would be read off twelve hours."""
    fine = make_dataset(tmp_path / "fine", systems=20, text=TANK.replace("step = 1800.0", "step = 900.0"))
    with pytest.raises(EstimatorError, match="its step is 900 s; the run was trained on 1800 s"):
        fit_posterior(load_run(own), fine, overwrite=True)


def test_of_few_calibrating_systems_it_is_told_that_they_are_too_few(own, many_tanks, recording, capsys, caplog):
    fit_posterior(own, many_tanks, systems=12, windows_per_system=8, epochs=8, overwrite=True)
    wanted = "its intervals are calibrated by 6 systems, too few for 90 %, which takes 9"
    assert wanted in caplog.text
    assert predict(own, recording).interval_doubt == wanted
    main(["predict", str(own), str(recording)])
    said = " ".join(capsys.readouterr().out.split())
    assert f"Do not rely on the intervals: {wanted}." in said


def test_a_posterior_that_tells_less_than_the_prior_is_not_recommended(many_tanks, recording, tmp_path, capsys):
    """Fitted to two windows, whose systems it knows by heart."""
    run = fit(many_tanks, tmp_path / "run", model="ridge", steps=20)
    found = fit_posterior(run, many_tanks, systems=4, windows_per_system=1, epochs=60)
    assert found.card.gain < 0
    main(["predict", str(run.folder), str(recording), "--json"])
    assert "tells less than the ranges of the parameters alone" in json.loads(capsys.readouterr().out)["interval_doubt"]
