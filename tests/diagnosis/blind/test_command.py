"""``diagnosis blind make`` as a command, with the lengths of gaps that it works out."""

import json

import pytest
from cyclopts import App

from diagnosis.blind.command import app as blind_app
from diagnosis.blind.sealed import open_answers, read_manifest


@pytest.mark.slow
def test_command(default_system, tmp_path, capsys):
    """With the real lengths."""
    app = App(result_action="return_value")
    app.command(blind_app)
    words = ["--system", str(default_system.path), "--recordings", "1", "--seed", "4", "--hours", "48", "--json"]
    assert app(["blind", "make", str(tmp_path / "set"), *words]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["answers_sha256"] == read_manifest(tmp_path / "set")["answers_sha256"]
    (answer,) = open_answers(tmp_path / "set", tmp_path / "set.answers.json")["recordings"]
    assert answer["detectability"]["length"] > 0.0
