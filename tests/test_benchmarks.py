"""The benchmarks are run by hand, for hours: that they still can be is told here."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from diagnosis.blind.intervals import share
from diagnosis.blind.score_report import by_chance, percent
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Sized, Verdict
from tests.diagnosis.blind.blind_cases import Case, write_results, write_set

SCRIPTS = Path(__file__).parent / "benchmarks"


@pytest.fixture
def beside(monkeypatch):
    """What a script finds when it is run: the files beside it."""
    monkeypatch.syspath_prepend(str(SCRIPTS))


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.py")), ids=lambda one: one.stem)
def test_a_benchmark_finds_all_that_it_imports(script, beside):
    assert runpy.run_path(str(script), run_name="tried")["__doc__"]


def test_shares_by_condition_are_those_of_the_score_with_its_intervals(beside, tmp_path, capsys, monkeypatch):
    """Also of a run that was stopped, of verdicts that do not say how long the processor worked."""
    said = Verdict(verdict="effect", probabilities={"a": 0.9, "b": 0.1, "c": 0.0}, named=["a"])
    said = said.model_copy(update={"sizes": {"a": Sized(value=3.0, low=2.0, high=4.0)}})
    ones = [
        Case("none", truth="no_gap", verdict=said),
        *(Case("library", (name,), room=3.0, verdict=said) for name in "aab"),
        Case("library", ("a",), room=3.0, verdict=said),
    ]
    folder, answers = write_set(tmp_path / "set", ones)
    results = write_results(tmp_path / "results", folder, ones)
    (results / "verdicts" / "0004.json").unlink()
    monkeypatch.setattr("sys.argv", ["by_condition.py", *map(str, (folder, answers, results)), "--first", "4"])
    runpy.run_path(str(SCRIPTS / "by_condition.py"), run_name="__main__")
    told = capsys.readouterr().out
    done = score(folder, answers, results, first=4)
    alarms, right = percent(done.false_alarms), percent(done.named_rightly)
    chance = by_chance(done.names.by_size[0].chance)
    assert chance.endswith("1.0 of 4)")  # one of three candidates, in three recordings of four
    assert f"| simulated | all | {alarms} | {right} | {chance} |" in told
    assert f"| simulated | a | {right} |" in told
    assert f"| 1 | {right} | {chance} |" in told
    assert f"rightly named: {percent(share([True, True]))}" in told


def test_a_room_to_forecast_is_read_as_a_recording(beside, default_system, tmp_path):
    unseen = runpy.run_path(str(SCRIPTS / "forecast.py"), run_name="tried")["unseen"]
    record = unseen(default_system, 5, 0, "sensor", 24.0, 24.0, tmp_path)
    assert record.outputs.shape == (len(default_system.outputs), 48)
    assert np.isfinite(record.outputs).all()
