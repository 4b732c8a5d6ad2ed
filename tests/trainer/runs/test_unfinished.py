"""A training that was cut short is told wherever its run is used."""

import json
import os

import pytest

from shared.errors import EstimatorError
from shared.lock import FolderLock
from trainer.evaluating.evaluation import evaluate
from trainer.posterior import calibration, fit_posterior
from trainer.runs.unfinished import unfinished
from trainer.training.fitting import fit

from ..conftest import interrupt_after
from ..test_cli import run as command

SMALL = {"width": 16, "layers": 1, "heads": 2, "feedforward": 32}
SAID = "The run's training was not finished: it was interrupted after step 30 of 100."


@pytest.fixture(scope="module")
def cut_short(tanks, tmp_path_factory):
    """Folder of a training of 100 steps that was stopped by Ctrl-C in the 31st."""
    folder = tmp_path_factory.mktemp("cut") / "run"
    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        interrupt_after(30, patch)
        fit(tanks, folder, options=SMALL, steps=100)
    return folder


def flat(text):
    return " ".join(text.split())


def test_every_command_says_that_a_training_was_cut_short(cut_short, tanks, tmp_path, capsys):
    shard, out = tanks / "shards" / "001.nc", tmp_path / "out"
    for arguments in (
        ("info", cut_short),
        ("evaluate", cut_short, tanks, "--windows", "20", "--out", out),
        ("predict", cut_short, shard),
    ):
        code, said, _ = command(capsys, *arguments)
        assert code == 0
        assert SAID in flat(said)
        code, said, _ = command(capsys, *arguments, "--json")
        assert code == 0
        assert json.loads(said)["unfinished"].startswith(SAID)
    assert SAID in (out / "evaluation.md").read_text()
    code, _, said = command(capsys, "posterior", cut_short, tanks, "--epochs", "1", "--windows-per-system", "2")
    assert code == 0
    assert f"warning: {cut_short}: {SAID}" in flat(said)
    arguments = ("calibration", cut_short, tanks, "--windows", "20", "--samples", "100", "--out", out)
    assert SAID in flat(command(capsys, *arguments)[1])
    assert json.loads(command(capsys, *arguments, "--json")[1])["unfinished"].startswith(SAID)
    assert SAID in (out / "calibration.md").read_text()


def test_a_training_that_came_to_its_end_has_no_such_sentence(ridge_run, tanks, tmp_path, capsys):
    assert unfinished(ridge_run.card) is None
    assert evaluate(ridge_run, tanks, windows=20, out=tmp_path).unfinished is None
    code, said, _ = command(capsys, "info", ridge_run.folder, "--json")
    assert (code, json.loads(said)["unfinished"]) == (0, None)
    assert "not finished" not in command(capsys, "info", ridge_run.folder)[1]


def test_every_reader_says_that_another_run_is_at_work_in_the_folder(own_ridge, tanks, tmp_path, capsys):
    shard, out = tanks / "shards" / "001.nc", tmp_path / "out"
    readers = (
        ("info", own_ridge),
        ("predict", own_ridge, shard),
        ("evaluate", own_ridge, tanks, "--windows", "20", "--out", out),
        ("calibration", own_ridge, tanks, "--windows", "20", "--samples", "20", "--out", out),
    )
    command(capsys, "posterior", own_ridge, tanks, "--epochs", "1", "--windows-per-system", "2")
    busy = f"Another run is at work in {own_ridge} (process {os.getpid()} on"
    with FolderLock(own_ridge):
        assert flat(busy) in flat(command(capsys, *readers[0])[1])
        for reader in readers:
            code, said, _ = command(capsys, *reader, "--json")
            assert code == 0 and json.loads(said)["unfinished"].startswith(busy)
    assert flat(busy) not in flat(command(capsys, *readers[0])[1])


@pytest.mark.parametrize("replaced", ["estimator", "posterior"])
def test_what_is_found_of_one_estimator_is_not_put_beside_another(own_ridge, tanks, tmp_path, monkeypatch, replaced):
    """A training or a posterior that replaces what is read while it is being read."""
    from trainer.posterior import assessment

    quick = {"epochs": 1, "windows_per_system": 2}
    fit_posterior(own_ridge, tanks, **quick)
    summarise = assessment.summarise

    def slow(drawn):
        if replaced == "estimator":
            fit(tanks, own_ridge, model="mean", overwrite=True)
        else:
            fit_posterior(own_ridge, tanks, **quick, seed=1, overwrite=True)
        return summarise(drawn)

    monkeypatch.setattr(assessment, "summarise", slow)
    with pytest.raises(EstimatorError, match=f"run: its {replaced} was replaced while it was at work with"):
        calibration(own_ridge, tanks, windows=20, samples=20)
    assert not (own_ridge / "calibration.json").exists()
