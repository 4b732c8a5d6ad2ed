"""``diagnosis blind make`` as a command: that on the page of a score makes the same set again."""

import json
import shlex
import shutil

import pytest

from diagnosis.blind.make import make
from diagnosis.blind.scoring import score
from diagnosis.blind.truth import default_truth
from diagnosis.cli import app
from shared.console import OK, start
from shared.store import sha256_of
from tests.diagnosis.blind.blind_cases import QUIET, Case, length_at_once, write_results


@pytest.fixture
def own(default_system, tmp_path):
    """A folder with a truth of its own in it, beside the FMU that it names."""
    truth = default_truth(default_system)
    shutil.copytree(truth.parent, tmp_path / "own", ignore=shutil.ignore_patterns("sources", "binaries"))
    (tmp_path / "own" / truth.name).rename(tmp_path / "own" / "mine.toml")
    with open(tmp_path / "own" / "mine.toml", "a", encoding="utf-8") as file:
        file.write("\n# of its own\n")
    return tmp_path / "own"


@pytest.mark.slow
def test_command(default_system, own, tmp_path, monkeypatch, capsys):
    """What is printed makes the same answers: of a system given by its file, a truth of its own, a chosen place."""
    monkeypatch.setattr("diagnosis.blind.make.detectability", length_at_once)
    sealed = tmp_path / "a.json"
    given = {"truth": own / "mine.toml", "answers": sealed}
    make(default_system.path, tmp_path / "set", recordings=1, seed=5, hours=24.0, **given)
    results = write_results(tmp_path / "results", tmp_path / "set", [Case("none", truth="no_gap", verdict=QUIET)])
    printed = score(tmp_path / "set", sealed, results).commands
    assert "--truth mine.toml" in printed[0]
    assert printed[1].startswith("diagnosis blind run MixedAirCO2 set --out results")
    (tmp_path / "set").rename(tmp_path / "before")
    before = sealed.rename(tmp_path / "before.json")
    monkeypatch.chdir(own)
    program, *words = shlex.split(printed[0])
    assert program == "diagnosis"
    assert start(app, [*words, "--json"]) == OK
    assert json.loads(capsys.readouterr().out)["answers_sha256"] == sha256_of(own / "a.json") == sha256_of(before)
