"""What a benchmark does and keeps: fits in turn and side by side, interrupted, failed, done before."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import trainer
from shared.errors import EstimatorError, IncompleteError
from shared.lock import FolderLock
from trainer.benchmarking import running
from trainer.benchmarking.conditions import Budget, Condition, Fit
from trainer.benchmarking.job import DONE, FAILED, SPEC, do
from trainer.benchmarking.planning import make_plan
from trainer.evaluating.report import read_answers
from trainer.runs.checkpoint import CARD, WEIGHTS

from ..test_cli import run as command
from .conftest import QUICK


@pytest.fixture(autouse=True)
def no_figures(monkeypatch):
    """Figures take most of the time of a benchmark with nothing left to do; test_results.py has them."""
    monkeypatch.setattr("trainer.benchmarking.page.draw", lambda *_: [])


def test_every_seed_is_scored_on_the_same_windows(results, short):
    plan = make_plan(short, results, **QUICK)
    one, other = (read_answers(plan.folder(plan.fit_of(plan.parts[0].rows[0].condition, seed))) for seed in (0, 1))
    for name in ("paper", "unseen"):
        np.testing.assert_array_equal(one[name].systems, other[name].systems)
        np.testing.assert_array_equal(one[name].begin, other[name].begin)
        np.testing.assert_array_equal(one[name].truth, other[name].truth)
    assert not np.array_equal(one["unseen"].estimate, other["unseen"].estimate)


def test_what_is_finished_is_not_done_again(finished, short, monkeypatch):
    before = {path: path.stat().st_mtime_ns for path in (finished / "fits").rglob("*")}
    monkeypatch.setattr(running, "do", lambda *_: pytest.fail("it was done again"))
    trainer.benchmark(short, finished, **QUICK)
    assert {path: path.stat().st_mtime_ns for path in (finished / "fits").rglob("*")} == before
    assert not make_plan(short, finished, **QUICK).left()
    assert len(make_plan(short, finished, **QUICK | {"windows": 61}).left()) == 12


def test_an_evaluation_by_hand_is_not_tabulated(finished, short, other_tanks):
    table = (finished / "channels.csv").read_bytes()
    plan = make_plan(short, finished, **QUICK)
    fit = plan.fits[-1]
    folder = plan.folder(fit)
    weights = (folder / WEIGHTS).stat().st_mtime_ns
    trainer.evaluate(folder, short, windows=QUICK["windows"], seed=0)  # the benchmark's own, once more
    assert not plan.left()
    trainer.evaluate(folder, short, windows=20, seed=3, noise="gauge")
    assert plan.left() == [fit]
    trainer.evaluate(folder, other_tanks, windows=QUICK["windows"], seed=0)
    assert plan.left() == [fit]
    trainer.benchmark(short, finished, **QUICK)
    assert (finished / "channels.csv").read_bytes() == table
    assert (folder / WEIGHTS).stat().st_mtime_ns == weights


def test_fits_of_other_versions_are_refused(finished, short):
    plan = make_plan(short, finished, **QUICK)
    path = plan.folder(plan.fits[3]) / CARD
    card = json.loads(path.read_text())
    card["versions"]["torch"] = "0.0.1"
    path.write_text(json.dumps(card))
    with pytest.raises(EstimatorError, match=r"estimator\.json: versions: torch is 0\.0\.1; expected .*as here"):
        trainer.benchmark(short, finished, **QUICK)


FEW = QUICK | {"ours": ["mean"]}
"""Fits that take no time."""


def test_an_interrupted_benchmark_writes_what_it_has_and_goes_on(short, tmp_path, monkeypatch):
    done = []

    def interrupted(dataset, folder, fit, ceiling):
        if len(done) == 2:
            raise KeyboardInterrupt
        do(dataset, folder, fit, ceiling)
        done.append(fit)

    monkeypatch.setattr(running, "do", interrupted)
    with pytest.raises(KeyboardInterrupt):
        trainer.benchmark(short, tmp_path, **FEW)
    page = (tmp_path / "results.md").read_text()
    assert "2 of 6 fits are finished" in page
    assert "a line has fewer than 2 seeds, or none" in page
    again = []

    def counted(dataset, folder, fit, ceiling):
        again.append(fit)
        do(dataset, folder, fit, ceiling)

    monkeypatch.setattr(running, "do", counted)
    trainer.benchmark(short, tmp_path, **FEW)
    assert len(again) == 4
    assert not {fit.key() for fit in done} & {fit.key() for fit in again}


def test_a_fit_that_fails_is_told_and_the_others_are_done(short, tmp_path, monkeypatch):
    from trainer.benchmarking import job

    fit = job.run_fit

    def fails(*arguments, **settings):
        if settings["model"] == "mean" and settings["seed"] == 1:
            raise EstimatorError("the dog ate it")
        return fit(*arguments, **settings)

    with (
        monkeypatch.context() as patch,
        pytest.raises(IncompleteError, match=r"3 of 6 fits failed; the first: mean, .* seed 1: the dog ate it"),
    ):
        patch.setattr(job, "run_fit", fails)
        trainer.benchmark(short, tmp_path, **FEW)
    page = (tmp_path / "results.md").read_text()
    assert "3 of 6 fits are finished" in page
    assert "**failed**: mean, 48 h, 1 channels, noise none, seed 1: the dog ate it" in page
    trainer.benchmark(short, tmp_path, **FEW)
    assert "**failed**" not in (tmp_path / "results.md").read_text()


@pytest.mark.slow
def test_a_fit_whose_process_died_is_on_the_page_and_ends_as_in_turn_when_it_is_done_again(
    results, finished, short, monkeypatch
):
    plan = make_plan(short, finished, **QUICK)
    fit = plan.fit_of(plan.parts[0].rows[0].condition, 0)
    assert fit.condition.model == "lstm"
    folder = plan.folder(fit)
    for name in (DONE, WEIGHTS, CARD):
        (folder / name).unlink()
    (folder / FAILED).write_text("what it had failed of the day before")
    dead = [sys.executable, "-c", "import os; os._exit(9)"]
    monkeypatch.setattr(running.children, "command", lambda *_: dead)
    with pytest.raises(IncompleteError, match=r"1 of 12 fits failed; .*: its process ended with code 9; "):
        trainer.benchmark(short, finished, workers=2, **QUICK)
    said = f"its process ended with code 9; {Path('fits') / folder.name / 'log.txt'} holds what it said"
    assert f"- **failed**: {fit.title()}: {said}\n" in (finished / "results.md").read_text()
    monkeypatch.undo()
    trainer.benchmark(short, finished, workers=2, **QUICK)
    assert "**failed**" not in (finished / "results.md").read_text()
    assert (folder / WEIGHTS).read_bytes() == (results / "fits" / fit.key() / WEIGHTS).read_bytes()


def test_results_of_another_dataset_are_left_alone(finished, other_tanks):
    with pytest.raises(EstimatorError, match=r"benchmark of this very dataset: systems was 100 and is 20 now"):
        trainer.benchmark(other_tanks, finished, **QUICK)


def test_a_second_benchmark_in_a_folder_is_told_which_process_is_there(finished, short):
    (finished / "results.md").unlink()
    with FolderLock(finished), pytest.raises(EstimatorError, match=rf"another run is at it \(process {os.getpid()} on"):
        trainer.benchmark(short, finished, **QUICK)
    assert not (finished / "results.md").exists()
    (finished / ".lock").write_text("")  # as earlier versions left it
    trainer.benchmark(short, finished, **QUICK)
    assert (finished / "results.md").exists()


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


def test_the_command(finished, short, tmp_path, capsys):
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
    code, out, _ = command(capsys, *arguments, "--out", finished, "--plan")
    assert "12 fits (a condition that several parts share is fitted once), 0 left" in out
    code, out, err = command(capsys, *arguments, "--out", tmp_path / "other", "--json")
    assert (code, out) == (1, "")
    assert "json: prints a plan, and there is none; expected --plan, too" in err
    assert not (tmp_path / "other").exists()
    code, out, err = command(capsys, *arguments, "--out", finished, "--quiet")
    assert (code, out, err) == (0, "", "")
    code, out, err = command(capsys, *arguments, "--out", finished)
    assert (code, out) == (0, "")
    assert f"written: {finished / 'results.md'}" in err
