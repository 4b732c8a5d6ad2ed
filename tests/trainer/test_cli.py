import json
import subprocess
import sys

import pytest

from trainer.cli import main
from trainer.models import ESTIMATORS


def run(capsys, *arguments):
    """Exit code, stdout and stderr of the command."""
    try:
        main([str(a) for a in arguments])
        code = 0
    except SystemExit as stop:
        code = stop.code
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_a_first_session(tanks, tmp_path, capsys):
    folder = tmp_path / "run"
    code, out, err = run(capsys, "fit", tanks, "--model", "ridge", "--context", "24", "--out", folder, "--steps", "2")
    assert (code, out) == (0, "")
    assert "validation loss" in err
    code, out, err = run(capsys, "evaluate", folder, tanks, "--json", "--windows", "100")
    assert code == 0
    found = json.loads(out)
    assert found["schema_version"] == 3
    assert (found["dataset"]["root_seeds"], found["dataset"]["systems"]) == ([1], 100)
    assert set(found["protocols"]) == {"paper", "unseen"}
    code, out, _ = run(capsys, "evaluate", folder, tanks)
    assert code == 0
    assert "tank.drain" in out
    assert "unseen: 100 disjoint windows of 10 systems, 0 of which" in out
    shard = tanks / "shards" / "001.nc"
    code, out, _ = run(capsys, "predict", folder, shard, "--json")
    assert code == 0
    assert len(json.loads(out)["predictions"]) == 50
    code, out, _ = run(capsys, "predict", folder, shard)
    assert "tank.fill" in out
    code, out, _ = run(capsys, "info", folder)
    assert "80 systems of root seed 1" in out
    code, out, _ = run(capsys, "info", folder, "--json")
    assert json.loads(out)["model"] == "ridge"


def test_options_reach_the_model(tanks, tmp_path, capsys):
    words = ["--patch", "6", "--option.width", "16", "--option.layers", "1", "--channels", "level", "time_of_day"]
    assert run(capsys, "fit", tanks, "--out", tmp_path / "run", "--steps", "2", *words)[0] == 0
    card = json.loads((tmp_path / "run" / "estimator.json").read_text())
    assert (card["options"]["patch"], card["options"]["width"], card["options"]["layers"]) == (6, 16, 1)
    assert card["encoding"]["derived"] == ["time_of_day"]


def test_what_the_user_can_mend_is_a_sentence_and_exit_code_1(tanks, tmp_path, capsys):
    for arguments in (
        ("fit", tmp_path, "--out", tmp_path / "run"),
        ("fit", tanks, "--out", tmp_path / "run", "--model", "forest"),
        ("evaluate", tmp_path, tanks),
        ("predict", tmp_path, tmp_path / "x.nc"),
    ):
        code, out, err = run(capsys, *arguments)
        assert (code, out) == (1, "")
        assert err.startswith("error: ")
        assert err.count("\n") == 1
        assert "Traceback" not in err


@pytest.mark.parametrize("arguments", [("fit",), ("train",), ("fit", "x", "--out", "y", "--steps", "many")])
def test_wrong_usage_is_exit_code_2(arguments, capsys):
    assert run(capsys, *arguments)[0] == 2


@pytest.mark.parametrize("command", ["fit", "evaluate", "calibration", "predict", "posterior", "tune"])
def test_a_negative_seed_is_a_sentence(own_ridge, tanks, tmp_path, capsys, command):
    words = {
        "fit": (tanks, "--out", tmp_path / "new", "--model", "mean"),
        "tune": (tanks, "--out", tmp_path / "new", "--model", "lstm"),
        "predict": (own_ridge, tanks / "shards" / "000.nc"),
    }
    found = run(capsys, command, *words.get(command, (own_ridge, tanks)), "--seed", "-1")
    assert found == (1, "", "error: seed: is -1; expected a whole number of at least 0\n")
    assert not (tmp_path / "new").exists()


def test_help_teaches_and_does_not_wait_for_torch(capsys):
    code, out, _ = run(capsys, "--help")
    assert code == 0
    assert "trainer fit DATASET" in out
    _, out, _ = run(capsys, "fit", "--help")
    assert all(name in out for name in ESTIMATORS)
    check = "import sys, trainer.cli; sys.exit('torch' in sys.modules or 'matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", check], check=True)
