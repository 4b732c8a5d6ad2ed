"""A training that was cut short is told wherever its run is used."""

import json

import pytest

from trainer.evaluating.evaluation import evaluate
from trainer.runs.checkpoint import load_run, read_card
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
