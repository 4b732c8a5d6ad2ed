"""Scores against what is known of them, and the calibration's protocol, tables and figures."""

import json
from types import SimpleNamespace

import matplotlib.image
import numpy as np
import pytest
import torch
from cyclopts import App
from scipy import stats

from shared.errors import EstimatorError
from shared.store import DatasetFolder
from trainer.posterior import calibration, figures, fit_posterior, load_posterior
from trainer.posterior.command import calibration as calibration_command
from trainer.posterior.command import posterior as posterior_command
from trainer.posterior.inference import summarise
from trainer.posterior.report import notes
from trainer.posterior.scores import bins_for, covered, crps, positions, truncated_normal, uniformity
from trainer.posterior.tempering import SAMPLES, _needed
from trainer.reading.windows import WindowSource
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


def test_a_rank_is_known_exactly():
    samples = np.arange(1.0, 10.0)[None, :, None]
    for truth, rank in ((0.5, 0), (4.5, 4), (9.5, 9)):
        found = positions(np.array([[truth]]), samples, np.random.default_rng(0))
        assert rank / 10 <= found[0, 0] < (rank + 1) / 10


@pytest.mark.parametrize("n", [20, 39, 150])
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


def test_temperatures_are_set_by_ends_of_the_same_kind():
    rng = np.random.default_rng(0)
    samples, z = rng.normal(size=(40, SAMPLES, 2)).astype(np.float32), rng.normal(size=(40, 2)).astype(np.float32)
    flow = SimpleNamespace(sample=lambda *_: torch.from_numpy(samples), centre=lambda _: torch.zeros(40, 2))
    found = _needed(flow, torch.zeros(40, 1), torch.from_numpy(z), torch.Generator())
    ends = summarise(samples)
    assert found.numpy() == pytest.approx(np.where(z > 0, z / ends.high, z / ends.low), rel=1e-5)


def test_the_lines_of_a_corner_plot_are_those_of_the_table(tmp_path, monkeypatch):
    seen, samples = [], np.random.default_rng(0).uniform(1, 3, (40, 2))
    monkeypatch.setattr(figures, "save_png", lambda figure, _: seen.append(figure))
    figures.draw_corner(samples, ["a", "b"], ["1", "1"], [(1, 3), (1, 3)], tmp_path / "c.png")
    found = summarise(samples[None])
    for k, axes in enumerate((seen[0].axes[0], seen[0].axes[3])):
        dashed = sorted(line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == "--")
        assert dashed == pytest.approx([found.low[0, k], found.median[0, k], found.high[0, k]])


def test_a_narrow_posterior_is_drawn_over_what_its_samples_reach(tmp_path, monkeypatch):
    """A thousandth of the prior's range: in thirty bins over all of that it would fill one."""
    rng, seen = np.random.default_rng(0), []
    samples = np.stack([rng.normal(5.0, 0.002, 4000), rng.uniform(0, 1, 4000)], axis=1)
    monkeypatch.setattr(figures, "save_png", lambda figure, _: seen.append(figure))
    figures.draw_corner(samples, ["a", "b"], ["1", "1"], [(0, 10), (0, 1)], tmp_path / "c.png")
    narrow, wide = seen[0].axes[0], seen[0].axes[3]
    low, high = narrow.get_xlim()
    assert low < samples[:, 0].min() and samples[:, 0].max() < high and high - low < 1.5 * np.ptp(samples[:, 0])
    solid = [[line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == "-"] for axes in (narrow, wide)]
    assert solid == [[], [0, 1]]
    assert (narrow.get_title(), "50 and 90 %" in seen[0].get_suptitle().replace("\n", " ")) == ("prior 0 to 10", True)


def test_no_two_lines_of_coverage_look_alike(tmp_path, monkeypatch):
    seen, names = [], [f"p{k}" for k in range(12)]
    monkeypatch.setattr(figures, "save_png", lambda figure, _: seen.append(figure))
    figures.draw_coverage(np.random.default_rng(0).uniform(size=(40, 12)), 40, names, "toy", tmp_path / "c.png")
    lines = [line for line in seen[0].axes[0].lines if line.get_label() in names]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 12


def test_bins_hold_enough_systems():
    assert [bins_for(n) for n in (5, 39, 40, 60, 10_000)] == [0, 0, 4, 6, 20]


def test_few_systems_have_no_histogram_that_looks_flat(tmp_path, monkeypatch):
    """Truths all in the middle: a posterior far too wide, which two bars would show as a perfect one."""
    seen, position = [], 0.5 + np.random.default_rng(0).uniform(-0.01, 0.01, (28, 2))
    monkeypatch.setattr(figures, "save_png", lambda figure, _: seen.append(figure))
    figures.draw_ranks(position, ["a", "b"], "toy", tmp_path / "sbc.png")
    chi2, kolmogorov = uniformity(position)
    assert np.isnan(chi2).all() and (kolmogorov < 1e-3).all()
    assert [axes.get_title() for axes in seen[0].axes[:2]] == ["a: p 0.00 (KS)", "b: p 0.00 (KS)"]
    assert "too few systems for a histogram, which takes 40" in seen[0].get_suptitle().replace("\n", " ")
    assert seen[0].axes[0].lines[0].get_xdata() == pytest.approx(position[:, 0])


def test_bars_are_held_against_whole_systems_and_a_band_that_is_seen(tmp_path, monkeypatch):
    seen, position = [], 0.5 + np.random.default_rng(0).uniform(-0.01, 0.01, (40, 1))
    monkeypatch.setattr(figures, "save_png", lambda figure, _: seen.append(figure))
    figures.draw_ranks(position, ["a"], "toy", tmp_path / "sbc.png")
    (axes,) = seen[0].axes
    assert [bar.get_height() for bar in axes.patches if bar.get_width() == pytest.approx(0.25)] == pytest.approx(
        np.histogram(position, [0, 0.25, 0.5, 0.75, 1])[0]
    )
    assert all(tick == round(tick) for tick in axes.get_yticks())
    bars = max(one.get_zorder() for one in axes.patches)
    edges = {line.get_ydata()[0] for line in axes.lines if line.get_zorder() > bars}
    assert edges >= set(stats.binom.interval(0.99, 40, 0.25))
    assert uniformity(position)[0][0] < 1e-3


def test_crps_of_a_normal_distribution():
    """The closed form of Gneiting and Raftery (2007, equation 21)."""
    rng = np.random.default_rng(1)
    truth = np.array([[0.0, 1.5], [-0.7, 4.0]])
    samples = rng.normal(size=(2, 20_000, 2)) * 2 + 1
    w = (truth - 1) / 2
    expected = 2 * (w * (2 * stats.norm.cdf(w) - 1) + 2 * stats.norm.pdf(w) - 1 / np.sqrt(np.pi))
    assert crps(truth, samples) == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize("n", [2, 20])
def test_few_samples_score_like_many_of_the_same_distribution(n):
    """A normal distribution whose truths are drawn from it scores 1 / sqrt(pi) on average."""
    rng = np.random.default_rng(n)
    truth, samples = rng.normal(size=(40_000, 1)), rng.normal(size=(40_000, n, 1))
    drawn = crps(truth, samples)
    assert drawn.mean() == pytest.approx(1 / np.sqrt(np.pi), abs=4 * drawn.std() / 200)
    levels = stats.norm.ppf((np.arange(200) + 0.5) / 200)[None, :, None]
    whole = crps(truth, np.broadcast_to(levels, (40_000, 200, 1)), quantiles=True)
    assert whole.mean() == pytest.approx(1 / np.sqrt(np.pi), abs=4 * whole.std() / 200)


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
    return make_dataset(tmp_path_factory.mktemp("cal") / "ds", systems=1000, root_seed=4)


@pytest.fixture(scope="module")
def folder(many_tanks, tmp_path_factory):
    run = fit(many_tanks, tmp_path_factory.mktemp("calrun") / "run", model="ridge", noise="gauge", steps=20)
    fit_posterior(run, many_tanks, windows_per_system=10, epochs=6)
    return run.folder


@pytest.fixture(scope="module")
def others(tmp_path_factory):
    """100 tanks of another root seed: all unseen."""
    return make_dataset(tmp_path_factory.mktemp("calother") / "ds", systems=100, root_seed=5)


@pytest.mark.slow
def test_intervals_cover_unseen_systems(folder, others, tmp_path):
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


def test_windows_come_from_systems_that_nothing_was_made_with(folder, many_tanks, tmp_path, monkeypatch):
    gather, looked, loaded = WindowSource.gather, [], []
    init = WindowSource.__init__

    def spy_init(self, records, *rest):
        loaded.extend(records.systems.tolist())
        init(self, records, *rest)

    def spy(self, rows, starts, length=None):
        looked.extend(rows.tolist())
        return gather(self, rows, starts, length)

    monkeypatch.setattr(WindowSource, "__init__", spy_init)
    monkeypatch.setattr(WindowSource, "gather", spy)
    calibration(folder, many_tanks, windows=60, samples=20, out=tmp_path)
    test = set(DatasetFolder(many_tanks).load([]).of_split("test").tolist())
    assert {loaded[row] for row in looked} <= test


def test_a_run_without_a_posterior_is_told(ridge_run, tanks):
    with pytest.raises(EstimatorError, match="has no posterior; `trainer posterior` fits one"):
        calibration(ridge_run, tanks)


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
