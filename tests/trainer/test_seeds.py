"""Seeds that numpy does not take."""

import pytest

from .test_cli import run

SENTENCE = "seed: is -1; expected a whole number of at least 0"


@pytest.mark.parametrize("command", ["fit", "evaluate", "calibration", "predict", "posterior", "tune"])
def test_a_negative_seed_is_a_sentence_and_exit_code_1(own_ridge, tanks, tmp_path, capsys, command):
    words = {
        "fit": (tanks, "--out", tmp_path / "new", "--model", "mean"),
        "tune": (tanks, "--out", tmp_path / "new", "--model", "lstm"),
        "predict": (own_ridge, tanks / "shards" / "000.nc"),
    }
    code, out, err = run(capsys, command, *words.get(command, (own_ridge, tanks)), "--seed", "-1")
    assert (code, out, err) == (1, "", f"error: {SENTENCE}\n")
    assert not (tmp_path / "new").exists()
