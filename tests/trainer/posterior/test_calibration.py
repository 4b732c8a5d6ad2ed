"""Scores against what is known of them, and the calibration's protocol, tables and figures."""

import json
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest
from cyclopts import App
from scipy import stats

from shared.store import DatasetFolder
from trainer.posterior import calibration, fit_posterior, load_posterior
from trainer.posterior.command import calibration as calibration_command
from trainer.posterior.command import posterior as posterior_command
from trainer.posterior.inference import summarise
from trainer.posterior.report import notes
from trainer.posterior.scores import covered, crps, positions, truncated_normal, uniformity
from trainer.runs.checkpoint import load_run
from trainer.training.fitting import fit

from ..conftest import make_dataset


def test_positions_of_a_truth_drawn_like_the_samples_are_uniform():
    rng = np.random.default_rng(0)
    truth, samples = rng.normal(size=(2000, 2)), rng.normal(size=(2000, 99, 2))
    position = positions(truth, samples, rng)
    assert stats.kstest(position[:, 0], "uniform").pvalue > 0.01
    for level in (0.5, 0.9):
        assert covered(position, level).mean(axis=0) == pytest.approx(np.full(2, level), abs=0.04)
    chi2, kolmogorov = uniformity(position)
    assert (chi2 > 0.001).all()
    assert (kolmogorov > 0.001).all()
    # samples half as wide as they should be cover what 0.82 standard deviations do
    narrow = positions(truth, 0.5 * samples, rng)
    assert covered(narrow, 0.9).mean() == pytest.approx(2 * stats.norm.cdf(0.8224) - 1, abs=0.03)
    assert (uniformity(narrow)[0] < 1e-6).all()
    shifted = positions(truth + 0.5, samples, rng)
    assert (uniformity(shifted)[1] < 1e-6).all()


@pytest.mark.parametrize("n", [20, 150])
def test_an_interval_of_few_samples_holds_what_it_says(n):
    """Truths drawn like the samples; and the ends by hand, from the sorted samples."""
    rng = np.random.default_rng(n)
    truth, samples = rng.gamma(2.0, size=(20_000, 2)), rng.gamma(2.0, size=(20_000, n, 2))
    found = summarise(samples)
    share = ((found.low < truth) & (truth < found.high)).mean()
    assert share == pytest.approx(0.9, abs=4 * np.sqrt(0.9 * 0.1 / 40_000))  # 0.81 with numpy's own rule and n = 20
    ordered = np.sort(samples, axis=1)
    below, rest = divmod(0.05 * (n + 1), 1)
    k = round(below)
    low = ordered[:, k - 1] + rest * (ordered[:, k] - ordered[:, k - 1])
    high = ordered[:, n - k] + rest * (ordered[:, n - k - 1] - ordered[:, n - k])
    assert found.low == pytest.approx(low)
    assert found.high == pytest.approx(high)


def test_crps_of_a_normal_distribution():
    """The closed form of Gneiting and Raftery (2007, equation 21)."""
    rng = np.random.default_rng(1)
    truth = np.array([[0.0, 1.5], [-0.7, 4.0]])
    samples = rng.normal(size=(2, 20_000, 2)) * 2 + 1
    w = (truth - 1) / 2
    expected = 2 * (w * (2 * stats.norm.cdf(w) - 1) + 2 * stats.norm.pdf(w) - 1 / np.sqrt(np.pi))
    assert crps(truth, samples) == pytest.approx(expected, abs=0.03)


def test_the_gaussian_to_beat_is_cut_off_at_the_ranges():
    middle, truth = np.array([[0.1, 0.5]]), np.array([[0.3, 0.4]])
    low, high, sd = np.zeros(2), np.ones(2), np.array([0.2, 0.1])
    quantiles, density = truncated_normal(middle, sd, low, high, truth, 999)
    law = stats.truncnorm((low - middle) / sd, (high - middle) / sd, middle, sd)
    assert quantiles[0, 499] == pytest.approx(law.ppf(0.5)[0])
    assert quantiles[0, 949] == pytest.approx(law.ppf(949.5 / 999)[0])
    assert density == pytest.approx(law.logpdf(truth).sum(axis=1))


@pytest.fixture(scope="module")
def many_tanks(tmp_path_factory):
    return make_dataset(tmp_path_factory.mktemp("cal") / "ds", systems=500, root_seed=4)


@pytest.fixture(scope="module")
def folder(many_tanks, tmp_path_factory):
    run = fit(many_tanks, tmp_path_factory.mktemp("calrun") / "run", model="ridge", noise="gauge", steps=5)
    fit_posterior(run, many_tanks, windows_per_system=10, epochs=6)
    return run.folder


@pytest.fixture(scope="module")
def others(tmp_path_factory):
    """100 tanks of another root seed: all unseen."""
    return make_dataset(tmp_path_factory.mktemp("calother") / "ds", systems=100, root_seed=5)


@pytest.mark.slow
def test_intervals_cover_unseen_systems_and_pictures_are_drawn(folder, others, tmp_path):
    found = calibration(folder, others, windows=600, samples=150, out=tmp_path)
    assert (found.windows, found.systems) == (600, 100)
    for one in found.parameters.values():
        cover = one.coverage["0.9"]
        assert cover.low <= cover.share <= cover.high
        assert 0.78 < cover.share < 0.99
        assert one.crps < one.crps_prior
        assert one.coverage["0.5"].share < cover.share < one.coverage["0.95"].share
    assert found.log_score.posterior > found.log_score.prior
    written = json.loads((tmp_path / "calibration.json").read_text())
    assert written == json.loads(found.model_dump_json())
    share = found.parameters["tank.fill"].coverage["0.9"].share
    assert f"| {100 * share:.1f} [" in (tmp_path / "calibration.md").read_text()
    lines = (tmp_path / "calibration.csv").read_text().splitlines()
    assert len(lines) == 1 + 4 * 3
    assert lines[7].startswith(f"tank.fill,0.9,{share}")
    for name in ("sbc.png", "coverage.png"):
        assert matplotlib.image.imread(tmp_path / name).shape[1] > 400


def test_systems_that_the_posterior_was_made_with_do_not_count(folder, others, tmp_path):
    """A posterior fitted to another dataset than the estimator must not be tested on that."""
    run = load_run(folder)
    own = tmp_path / "run"
    own.mkdir()
    for name in ("estimator.json", "weights.safetensors"):
        (own / name).write_bytes((run.folder / name).read_bytes())
    fit_posterior(own, others, windows_per_system=2, epochs=1)
    found = calibration(own, others, windows=1000, samples=20)
    test = DatasetFolder(others).load([]).of_split("test")
    assert found.systems == len(test) == 10
    assert {one.chi2_p for one in found.parameters.values()} == {None}
    assert "p: of the ranks being uniform, one window of each system; chi2 takes 40 systems" in notes(found)


def test_the_commands_do_it_all(folder, many_tanks, others, tmp_path, capsys, caplog):
    app = App(name="trainer", result_action="return_value")
    app.command(posterior_command, name="posterior")
    app.command(calibration_command, name="calibration")
    own = tmp_path / "run"
    own.mkdir()
    for name in ("estimator.json", "weights.safetensors"):
        (own / name).write_bytes((folder / name).read_bytes())
    caplog.set_level("INFO")
    app(["posterior", str(own), str(many_tanks), "--epochs", "1", "--systems", "12"])
    assert load_posterior(load_run(own)) is not None
    assert "calibrated by 6 others" in caplog.text
    capsys.readouterr()
    app(["calibration", str(own), str(others), "--windows", "50", "--samples", "20", "--json"])
    assert SimpleNamespace(**json.loads(capsys.readouterr().out)).windows == 50
    app(["calibration", str(own), str(others), "--windows", "50", "--samples", "20", "--out", str(tmp_path / "o")])
    shown = capsys.readouterr().out
    assert "tank.drain" in shown
    assert "neither estimator nor posterior has seen" in shown
    assert (tmp_path / "o" / "sbc.png").exists()
