"""A training that was cut short is told wherever its run is used."""

import json
import os
import shutil

import pytest

from shared.errors import EstimatorError
from shared.lock import FolderLock
from trainer.evaluating.evaluation import evaluate
from trainer.posterior import calibration, fit_posterior
from trainer.runs.checkpoint import load_run, read_card, save_run
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


def test_a_caller_that_uses_the_values_alone_is_warned(cut_short, tanks, tmp_path, caplog):
    from trainer import predict

    predict(cut_short, tanks / "shards" / "001.nc")
    assert SAID in caplog.text
    caplog.clear()
    fit(tanks, tmp_path / "next", options=SMALL, steps=1, begin_with=cut_short)
    assert f"begin_with: {cut_short}: {SAID}" in caplog.text


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
    for locked in (True, False):
        for reader in readers:
            with FolderLock(own_ridge if locked else tmp_path):
                code, said, _ = command(capsys, *reader)
                assert code == 0
                assert (flat(busy) in flat(said)) is locked
                found = json.loads(command(capsys, *reader, "--json")[1])["unfinished"]
                assert (found or "").startswith(busy) is locked


def test_a_training_that_is_under_way_is_told_with_its_process(cut_short, monkeypatch):
    with FolderLock(cut_short):
        said = unfinished(read_card(cut_short), cut_short)
    assert said.startswith(SAID)
    assert f"Another run is at work in {cut_short} now (process {os.getpid()} on" in said
    assert "--resume" not in said


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


@pytest.mark.parametrize("way", ["as it is", "otherwise"])
def test_an_evaluation_is_not_put_beside_another_estimator(own_ridge, tanks, monkeypatch, way):
    """Also where the run's own folder is written in another way."""
    from trainer.evaluating import evaluation

    find = evaluation.find_ceiling

    def slow(*arguments, **settings):
        fit(tanks, own_ridge, model="mean", overwrite=True)
        return find(*arguments, **settings)

    monkeypatch.setattr(evaluation, "find_ceiling", slow)
    with pytest.raises(EstimatorError, match="run: its estimator was replaced while it was at work with"):
        evaluate(own_ridge, tanks, windows=20, out=None if way == "as it is" else own_ridge / ".." / own_ridge.name)
    assert not (own_ridge / "evaluation.json").exists()


@pytest.mark.parametrize("what", [evaluate, calibration])
def test_findings_of_one_estimator_are_not_written_over_anothers(own_ridge, tanks, tmp_path, what):
    """They would stand beside weights that they are not of."""
    fit_posterior(own_ridge, tanks, epochs=1, windows_per_system=2)
    fit(tanks, tmp_path / "other", model="mean")
    sentence = r"^out: .*other holds another estimator \(estimator\.json\), .*; expected another folder$"
    with pytest.raises(EstimatorError, match=sentence):
        what(own_ridge, tanks, windows=20, out=tmp_path / "other")
    assert not {"evaluation.json", "calibration.json"} & {path.name for path in (tmp_path / "other").iterdir()}
    copy = shutil.copytree(own_ridge, tmp_path / "copy")
    what(own_ridge, tanks, windows=20, out=copy)
    assert {"evaluation.json", "calibration.json"} & {path.name for path in copy.iterdir()}


@pytest.mark.parametrize("found", ["evaluation", "calibration"])
def test_a_training_that_is_at_work_replaces_what_is_being_read(own_ridge, tanks, tmp_path, monkeypatch, found):
    """`fit --overwrite`, whose first estimator comes while the old one is looked at."""
    from trainer.evaluating import evaluation
    from trainer.posterior import assessment

    fit_posterior(own_ridge, tanks, epochs=1, windows_per_system=2)
    other = fit(tanks, tmp_path / "other", model="mean")
    module = evaluation if found == "evaluation" else assessment
    look = module.unseen_rows

    def slow(*arguments):
        save_run(own_ridge, other.card, other.model)
        return look(*arguments)

    monkeypatch.setattr(module, "unseen_rows", slow)
    sentence = "run: its estimator was replaced while it was at work with"
    with FolderLock(own_ridge), pytest.raises(EstimatorError, match=sentence):
        if found == "evaluation":
            evaluate(own_ridge, tanks, windows=20)
        else:
            calibration(own_ridge, tanks, windows=20, samples=20)
    assert not (own_ridge / f"{found}.json").exists()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"stopped": "running"}, "it is under way, or was killed, after step 30 of 100."),
        ({"planned": None}, "it was interrupted after step 30."),
        ({"planned": None, "minutes": 5.0, "seconds": 90.0}, "it was interrupted after step 30, 1.5 of 5 min."),
        ({"stopped": "not a number"}, "its loss stopped being a number after step 30 of 100."),
    ],
)
def test_it_is_said_how_far_a_training_came(cut_short, changes, words):
    card = read_card(cut_short)
    said = unfinished(card.model_copy(update={"training": card.training.model_copy(update=changes)}))
    assert words in said
    assert ("--resume" in said) == (changes.get("stopped") != "not a number")


def test_a_training_that_was_gone_on_with_is_finished(cut_short, tanks, tmp_path):
    own = tmp_path / "run"
    own.mkdir()
    for path in cut_short.iterdir():
        (own / path.name).write_bytes(path.read_bytes())
    fit(tanks, own, options=SMALL, steps=100, resume=True)
    assert unfinished(load_run(own).card) is None
