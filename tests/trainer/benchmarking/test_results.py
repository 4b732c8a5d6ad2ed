"""That the numbers of a benchmark are those of its fits, and what its pages say."""

import csv
import json
import math
import os
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import trainer
from shared.errors import EstimatorError
from shared.metrics import r2
from trainer.benchmarking.gathering import read_evaluation, scores_of
from trainer.benchmarking.planning import make_plan
from trainer.benchmarking.published import read_published
from trainer.evaluating.report import Answers

from .conftest import QUICK


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def answers_of(estimate, truth, systems):
    return Answers(np.array([1] * len(truth), dtype=object), systems, np.zeros(len(truth)), truth, estimate)


def test_the_tables_hold_the_scores_of_the_fits(results, short):
    plan = make_plan(short, results, **QUICK)
    rows = rows_of(results / "channels.csv")
    assert len(rows) == 6 * 2 * 3
    for row in plan.parts[0].rows:
        folders = [plan.folder(plan.fit_of(row.condition, seed)) for seed in range(2)]
        scores = [read_evaluation(folder).protocols["unseen"] for folder in folders]
        found = {
            line["parameter"]: line
            for line in rows
            if (line["estimator"], line["channels"]) == row.labels and line["protocol"] == "unseen"
        }
        for parameter in ("tank.drain", "tank.fill"):
            values = [one.r2[parameter] for one in scores]
            assert float(found[parameter]["r2"]) == pytest.approx(np.mean(values), abs=1e-5)
            spread = abs(values[0] - values[1]) / math.sqrt(2)
            assert float(found[parameter]["r2_sd"]) == pytest.approx(spread, abs=1e-5)
        line = found["mean"]
        assert float(line["r2"]) == pytest.approx(np.mean([one.r2_mean for one in scores]), abs=1e-5)
        assert float(line["r2_low"]) <= float(line["r2"]) <= float(line["r2_high"])
        assert (line["seeds"], line["windows"], line["systems"], line["systems_trained_on"]) == ("2", "10", "10", "0")
        assert line["ceiling"] == line["published"] == ""
    wanted = ("lstm", "level", "unseen", "mean")
    line = next(r for r in rows if (r["estimator"], r["channels"], r["protocol"], r["parameter"]) == wanted)
    assert (line["training_systems"], line["steps"], line["batch_size"]) == ("80", "2", "16")


def test_the_page_says_how_its_numbers_came_about(results):
    page = (results / "results.md").read_text()
    for words in (
        "trainer benchmark tanks",
        "100 systems of Tank, records of 48 h in steps of 1800 s, 80 training systems",
        "budget of each fit: 2 steps",
        "12 of 12 fits are finished",
        f"{os.cpu_count()} cores",
        "## What each added sensor buys",
        "| lstm | level |",
        "| tank.drain |",
        "identifiability.json does not exist",
        "2,000 simulations",
        "2000 training iterations",
        "in the unit that\n  was given, steps or minutes; windows a step are each model's own",
        "hourly",
    ):
        assert words in page, words
    assert (results / "channels.md").read_text() in page
    assert matplotlib.image.imread(results / "channels.png").std() > 0


def test_intervals_are_of_the_mean_over_seeds_and_by_system():
    rng = np.random.default_rng(0)
    systems = np.repeat(np.arange(12), 5)
    truth = rng.uniform(1, 2, (12, 2))[systems]
    answers = [answers_of(truth + rng.normal(0, 0.1, truth.shape), truth, systems) for _ in range(3)]
    scores = scores_of(answers, 7)
    each = np.array([r2(one.truth, one.estimate) for one in answers])
    np.testing.assert_allclose(scores.mean[:2], each.mean(axis=0))
    np.testing.assert_allclose(scores.sd[:2], each.std(axis=0, ddof=1))
    assert scores.mean[2] == pytest.approx(each.mean())
    assert (scores.windows, scores.systems, scores.trained_on) == (60, 12, 7)
    # windows of one system are copies of one answer: the interval must be as wide as that of twelve windows
    one = [answers_of(a.estimate[::5], a.truth[::5], systems[::5]) for a in answers]
    copies = [answers_of(a.estimate[::5][systems], truth, systems) for a in answers]
    np.testing.assert_allclose(scores_of(copies, 0).low, scores_of(one, 0).low)
    np.testing.assert_allclose(scores_of(copies, 0).high, scores_of(one, 0).high)
    assert np.isnan(scores_of(answers[:1], 0).sd).all()


def test_published_figures_stand_beside_ours(finished, short, tmp_path):
    path = tmp_path / "published.json"
    figures = [
        {"part": "channels", "labels": ["lstm", "level"], "r2": {"tank.drain": 0.75, "tank.fill": 0.25}},
        {"part": "channels", "labels": ["mean", "level"], "mean": 0.125},
    ]
    path.write_text(json.dumps({"source": "A book", "figures": figures}))
    trainer.benchmark(short, finished, published=path, **QUICK)
    page = (finished / "results.md").read_text()
    assert "- published: A book" in page
    assert "| 0.500 |" in page
    assert "| 0.125 |" in page
    assert "/ - / 0.750 |" in page
    path.write_text('{"figures": [{"part": "x"}]}')
    with pytest.raises(EstimatorError, match=r"figures\.0\.labels: Field required"):
        read_published(path)
    with pytest.raises(EstimatorError, match="no such file"):
        read_published(tmp_path / "none.json")
    assert read_published(Path("MixedAirCO2")).find("table4", ("24", "lstm"), None) == pytest.approx(-0.028, abs=5e-4)


def test_figures_of_the_paper(short, tmp_path):
    parts = ["figure4", "figure5", "systems"]
    trainer.benchmark(short, tmp_path, parts=parts, ours=["lstm"], steps=1, seeds=1, windows=40)
    for name in ("figure4-lstm", "figure4-patch-transformer", "figure5-lstm", "figure5-patch-transformer", "systems"):
        assert matplotlib.image.imread(tmp_path / f"{name}.png").std() > 0, name
    header = rows_of(tmp_path / "figure5.csv")[0]
    assert 0 < float(header["relative_accuracy"]) <= 1
    assert "accuracy unseen" in (tmp_path / "figure5.md").read_text()
