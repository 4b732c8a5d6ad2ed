"""The benchmark: what is planned, what is done and kept, and that its numbers are those of its fits."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time

import matplotlib.image
import numpy as np
import pytest

import trainer
from shared.errors import EstimatorError
from shared.metrics import r2
from trainer.benchmarking import running
from trainer.benchmarking.conditions import Budget, Condition, Fit
from trainer.benchmarking.gathering import gather, read_evaluation, scores_of
from trainer.benchmarking.job import DONE, SPEC, do, is_done
from trainer.benchmarking.parts import PARTS, channel_sets
from trainer.benchmarking.planning import make_plan
from trainer.benchmarking.published import read_published
from trainer.checkpoint import read_card
from trainer.report import Answers, read_answers

from .conftest import TANK, make_dataset, tank_system
from .test_cli import run as command

QUICK = {"parts": ["channels"], "ours": ["lstm", "mean"], "steps": 2, "seeds": 2, "windows": 60}


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A dataset of 100 tanks over two days."""
    return make_dataset(tmp_path_factory.mktemp("short") / "ds", text=TANK.replace("hours = 240.0", "hours = 48.0"))


@pytest.fixture(scope="module")
def results(short, tmp_path_factory):
    """A finished benchmark of six lines, two seeds each."""
    out = tmp_path_factory.mktemp("results")
    trainer.benchmark(short, out, command="trainer benchmark tanks", **QUICK)
    return out


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_channels_come_from_the_roles_of_the_description():
    sets = channel_sets(tank_system())
    clock = ("time_of_day", "day_of_week")
    assert sets == {
        "level": ("level",),
        "+ clock": ("level", *clock),
        "+ clock, all outputs": ("level", *clock, "glow"),
    }
    weather = '[weather]\nfiles = ["x"]\nsurface_tilt = 90.0\nsurface_azimuth = 180.0\n'
    rain = '[[inputs]]\nname = "rain"\nunit = "mm"\nsource = "weather"\ncolumn = "rain"\n'
    more = '[[outputs]]\nname = "hum"\nunit = "dB"\naccuracy = 1.0\n'
    sets = channel_sets(tank_system(TANK + rain + more + weather))
    known = ("level", "rain", *clock)
    assert sets["+ weather and clock"] == known
    assert sets["+ weather and clock, hum"] == (*known, "hum")
    assert sets["+ weather and clock, all outputs"] == (*known, "glow", "hum")
    assert not any("valve" in channels for channels in sets.values())


def test_a_plan_fits_each_condition_once_and_says_what_it_skips(tanks, tmp_path):
    plan = make_plan(tanks, tmp_path / "out", seeds=2, minutes=0.5)
    assert [part.name for part in plan.parts] == list(PARTS)
    parts = {part.name: part for part in plan.parts}
    assert [row.labels for row in parts["table3"].rows] == [("4",), ("12",), ("24",)]
    lines = [row.labels for row in parts["table4"].rows]
    assert len(lines) == 3 * 6
    assert ("72", "tcn") in lines
    assert {row.condition.context_hours for row in parts["figure5"].rows} == {24.0, 48.0, 96.0, 168.0}
    skipped = [f"context {hours} h is skipped: the dataset's records are 240 h long" for hours in (360, 720)]
    assert parts["figure5"].notes == skipped
    assert [row.labels[1] for row in parts["systems"].rows] == ["80"] * 3
    assert parts["systems"].notes[0] == "80 systems are skipped: the dataset has 80 training systems"
    assert {row.labels[2] for row in parts["noise"].rows} == {"none", "gauge"}
    conditions = {row.condition for part in plan.parts for row in part.rows}
    assert len(plan.fits) == 2 * len(conditions)
    assert len({fit.key() for fit in plan.fits}) == len(plan.fits)
    assert [fit.seed for fit in plan.fits] == [0] * len(conditions) + [1] * len(conditions)
    solved = sum(fit.condition.model in ("ridge", "mean") for fit in plan.fits)
    assert plan.minutes_left() == (0.5 * (len(plan.fits) - solved), False)
    assert not (tmp_path / "out").exists()


def test_more_systems_are_a_line_each(tmp_path):
    plan = make_plan(make_dataset(tmp_path / "ds", systems=120), tmp_path / "out", parts=["systems"], ours=["mean"])
    assert [row.labels for row in plan.parts[0].rows if row.labels[0] == "mean"] == [("mean", "80"), ("mean", "96")]
    assert [row.condition.systems for row in plan.parts[0].rows][:2] == [80, None]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"parts": ["table9"]}, "'table9' is unknown; found table3"),
        ({"seeds": 0}, "seeds: is 0"),
        ({"workers": 0}, "workers: is 0"),
        ({"minutes": -1.0}, "budget of a fit is not positive"),
        ({"minutes": 1.0, "steps": 5}, "both are given"),
        ({"ours": ["forest"]}, "'forest' is not an estimator"),
    ],
)
def test_wrong_arguments_are_named(tanks, tmp_path, arguments, words):
    with pytest.raises(EstimatorError, match=words):
        make_plan(tanks, tmp_path / "out", **arguments)


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
        "hourly",
    ):
        assert words in page, words
    assert (results / "channels.md").read_text() in page
    assert matplotlib.image.imread(results / "channels.png").std() > 0


def test_every_seed_is_scored_on_the_same_windows(results, short):
    plan = make_plan(short, results, **QUICK)
    one, other = (read_answers(plan.folder(plan.fit_of(plan.parts[0].rows[0].condition, seed))) for seed in (0, 1))
    for name in ("paper", "unseen"):
        np.testing.assert_array_equal(one[name].systems, other[name].systems)
        np.testing.assert_array_equal(one[name].begin, other[name].begin)
        np.testing.assert_array_equal(one[name].truth, other[name].truth)
    assert not np.array_equal(one["unseen"].estimate, other["unseen"].estimate)


def test_what_is_finished_is_not_done_again(results, short, monkeypatch):
    before = {path: path.stat().st_mtime_ns for path in (results / "fits").rglob("*")}
    monkeypatch.setattr(running, "do", lambda *_: pytest.fail("it was done again"))
    trainer.benchmark(short, results, **QUICK)
    assert {path: path.stat().st_mtime_ns for path in (results / "fits").rglob("*")} == before
    assert not make_plan(short, results, **QUICK).left()
    assert len(make_plan(short, results, **QUICK | {"windows": 61}).left()) == 12


def test_an_interrupted_benchmark_writes_what_it_has_and_goes_on(short, tmp_path, monkeypatch):
    done = []

    def interrupted(dataset, folder, fit, ceiling):
        if len(done) == 4:
            raise KeyboardInterrupt
        do(dataset, folder, fit, ceiling)
        done.append(fit)

    monkeypatch.setattr(running, "do", interrupted)
    with pytest.raises(KeyboardInterrupt):
        trainer.benchmark(short, tmp_path, **QUICK)
    page = (tmp_path / "results.md").read_text()
    assert "4 of 12 fits are finished" in page
    assert "a line has fewer than 2 seeds, or none" in page
    again = []

    def counted(dataset, folder, fit, ceiling):
        again.append(fit)
        do(dataset, folder, fit, ceiling)

    monkeypatch.setattr(running, "do", counted)
    trainer.benchmark(short, tmp_path, **QUICK)
    assert len(again) == 8
    assert not {fit.key() for fit in done} & {fit.key() for fit in again}


def test_a_fit_that_fails_is_told_and_the_others_are_done(short, tmp_path, monkeypatch):
    from trainer.benchmarking import job

    fit = job.run_fit

    def fails(*arguments, **settings):
        if settings["model"] == "mean" and settings["seed"] == 1:
            raise EstimatorError("the dog ate it")
        return fit(*arguments, **settings)

    monkeypatch.setattr(job, "run_fit", fails)
    with pytest.raises(EstimatorError, match=r"3 of 12 fits failed; the first: mean, .* seed 1: the dog ate it"):
        trainer.benchmark(short, tmp_path, **QUICK)
    page = (tmp_path / "results.md").read_text()
    assert "9 of 12 fits are finished" in page
    assert "**failed**: mean, 48 h, 1 channels, noise none, seed 1: the dog ate it" in page
    monkeypatch.undo()
    trainer.benchmark(short, tmp_path, **QUICK)
    assert "**failed**" not in (tmp_path / "results.md").read_text()


def test_a_loss_that_is_not_a_number_is_scored_with_a_warning(short, tmp_path, monkeypatch):
    from .test_fitting import poison

    condition = Condition(model="lstm", context_hours=24.0, channels=("level",))
    fit = Fit(condition=condition, seed=0, budget=Budget(steps=40), windows=20)
    poison(monkeypatch, 25)
    do(short, tmp_path / "run", fit, None)
    assert "not a finite number at step 26" in json.loads((tmp_path / "run" / DONE).read_text())["warning"]
    assert is_done(tmp_path / "run", fit)
    assert not is_done(tmp_path / "run", fit.model_copy(update={"seed": 1}))


def test_results_of_another_dataset_are_left_alone(results, other_tanks, tmp_path):
    with pytest.raises(EstimatorError, match=r"holds a benchmark of another dataset: systems was 100 and is 20 now"):
        trainer.benchmark(other_tanks, results, **QUICK)


@pytest.mark.slow
def test_fits_side_by_side_are_the_same_as_in_turn(results, short, tmp_path):
    trainer.benchmark(short, tmp_path, workers=2, **QUICK | {"ours": ["lstm"], "seeds": 1})
    plan = make_plan(short, results, **QUICK)
    for row in plan.parts[0].rows[:3]:
        fit = plan.fit_of(row.condition, 0)
        assert fit.condition.model == "lstm"
        weights = [out / "fits" / fit.key() / "weights.safetensors" for out in (results, tmp_path)]
        assert weights[0].read_bytes() == weights[1].read_bytes()
    assert "3 of 3 fits are finished" in (tmp_path / "results.md").read_text()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does")
def test_a_fit_ends_when_the_benchmark_is_killed(short, tmp_path):
    condition = Condition(model="patch-transformer", context_hours=24.0, channels=("level",))
    fit = Fit(condition=condition, seed=0, budget=Budget(minutes=30), windows=20)
    (tmp_path / SPEC).write_text(fit.model_dump_json())
    child = [sys.executable, "-m", "trainer.benchmarking.job", str(short), str(tmp_path)]
    code = (
        "import subprocess, time\n"
        f"child = subprocess.Popen({child!r}, stdin=subprocess.PIPE)\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(600)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    pid = int(parent.stdout.readline())
    os.kill(pid, 0)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    for _ in range(600):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        with open(f"/proc/{pid}/stat") as file:  # an orphan that nobody waits for stays as a zombie
            if file.read().rsplit(")", 1)[1].split()[0] == "Z":
                return
        time.sleep(0.1)
    os.kill(pid, signal.SIGKILL)
    pytest.fail("it went on without its parent")


def answers_of(estimate, truth, systems):
    return Answers(np.array([1] * len(truth), dtype=object), systems, np.zeros(len(truth)), truth, estimate)


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


def test_published_figures_stand_beside_ours(results, short, tmp_path):
    path = tmp_path / "published.json"
    figures = [
        {"part": "channels", "labels": ["lstm", "level"], "r2": {"tank.drain": 0.75, "tank.fill": 0.25}},
        {"part": "channels", "labels": ["mean", "level"], "mean": 0.125},
    ]
    path.write_text(json.dumps({"source": "A book", "figures": figures}))
    trainer.benchmark(short, results, published=path, **QUICK)
    page = (results / "results.md").read_text()
    assert "- published: A book" in page
    assert "| 0.500 |" in page
    assert "| 0.125 |" in page
    assert "/ - / 0.750 |" in page
    path.write_text('{"figures": [{"part": "x"}]}')
    with pytest.raises(EstimatorError, match=r"figures\.0\.labels: Field required"):
        read_published(path)
    with pytest.raises(EstimatorError, match="no such file"):
        read_published(tmp_path / "none.json")


def test_a_condition_that_nobody_fitted_is_a_dash(short, tmp_path):
    plan = make_plan(short, tmp_path, parts=["table3"])
    assert gather(plan, plan.parts[0].rows[0].condition) is None


def test_pictures_of_the_paper(short, tmp_path):
    parts = ["figure4", "figure5", "systems"]
    trainer.benchmark(short, tmp_path, parts=parts, ours=["lstm"], steps=1, seeds=1, windows=40)
    for name in ("figure4-lstm", "figure4-patch-transformer", "figure5-lstm", "figure5-patch-transformer", "systems"):
        assert matplotlib.image.imread(tmp_path / f"{name}.png").std() > 0, name
    header = rows_of(tmp_path / "figure5.csv")[0]
    assert 0 < float(header["relative_accuracy"]) <= 1
    assert "accuracy unseen" in (tmp_path / "figure5.md").read_text()


def test_the_command(results, short, tmp_path, capsys):
    arguments = ["benchmark", short, "--parts", "channels", "--ours", "lstm", "mean", "--steps", "2"]
    arguments += ["--seeds", "2", "--windows", "60"]
    code, out, _ = command(capsys, *arguments, "--out", tmp_path / "new", "--plan", "--json")
    assert code == 0
    assert json.loads(out) == {
        "fits": 12,
        "left": 12,
        "minutes": None,
        "with_overheads": False,
        "parts": {"channels": {"lines": 6, "skipped": []}},
    }
    code, out, _ = command(capsys, *arguments, "--out", results, "--plan")
    assert "12 fits (a condition that several parts share is fitted once), 0 left" in out
    code, out, err = command(capsys, *arguments, "--out", results, "--quiet")
    assert (code, out) == (0, "")
    assert "results.md" in err


def test_fewer_systems_make_a_smaller_full_dataset(short, tmp_path):
    run = trainer.fit(short, tmp_path / "run", model="mean", systems=40)
    result = trainer.evaluate(run, short)
    assert (result.protocols["paper"].systems, result.protocols["paper"].systems_trained_on) == (50, 45)
    assert result.protocols["unseen"].systems == 10
    assert read_card(tmp_path / "run").training_systems.indices[-1] < 60
