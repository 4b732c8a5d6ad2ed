"""The commands on the page of a score make the same set again."""

import shlex
import shutil
from pathlib import Path

import pytest

from diagnosis.blind.make import make
from diagnosis.blind.scoring import score
from diagnosis.blind.truth import default_truth
from diagnosis.cli import app
from shared.console import OK, start
from shared.store import sha256_of
from shared.system import load_system
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
@pytest.mark.parametrize(
    ("system", "truth", "answers"),
    [("MixedAirCO2", "mine.toml", None), ("MixedAirCO2/system.toml", None, "a.json")],
)
def test_the_command_that_is_printed_makes_the_same_answers(own, tmp_path, monkeypatch, system, truth, answers):
    monkeypatch.setattr("diagnosis.blind.make.detectability", length_at_once)
    given = (
        Path(load_system("MixedAirCO2").path.parent.parent, system.removeprefix("fmus/")) if "/" in system else system
    )
    kept = {} if truth is None else {"truth": own / truth}
    sealed = tmp_path / "set.answers.json" if answers is None else tmp_path / answers
    make(given, tmp_path / "set", recordings=1, seed=5, hours=24.0, answers=sealed, **kept)
    results = write_results(tmp_path / "results", tmp_path / "set", [Case("none", truth="no_gap", verdict=QUIET)])
    printed = score(tmp_path / "set", sealed, results).commands
    assert ("--truth mine.toml" in printed[0]) == (truth is not None)
    (tmp_path / "set").rename(tmp_path / "before")
    before = sealed.rename(tmp_path / "before.json")
    monkeypatch.chdir(own)
    program, *words = shlex.split(printed[0])
    assert program == "diagnosis"
    assert start(app, words) == OK
    assert sha256_of(own / sealed.name) == sha256_of(before)
    assert printed[1].startswith("diagnosis blind run MixedAirCO2 set --out results")
