"""Verdicts of one run are of one program."""

import pytest

import diagnosis.blind.running as running
from diagnosis.blind.running import run
from diagnosis.blind.scoring import score
from shared.errors import RecordingError
from tests.diagnosis.blind.blind_cases import HandJudge, hand_set


def test_a_program_that_changes_while_it_runs_is_noticed(default_system, tmp_path, monkeypatch):
    blind_set, _ = hand_set(tmp_path / "set", default_system, [3.0, 0.0, 3.0])
    programs = iter(["first", "first", "first", "first", "second"])  # of the run, of each verdict, of the run's end
    monkeypatch.setattr(running, "program", lambda: next(programs))
    with pytest.raises(RecordingError, match="source changed while it ran"):
        run(default_system, blind_set, tmp_path / "out", workers=0, judge=HandJudge())


def test_a_verdict_of_another_program_is_not_one_of_the_run_s(default_system, tmp_path, monkeypatch):
    """Source that was changed and changed back while it ran."""
    blind_set, answers = hand_set(tmp_path / "set", default_system, [3.0, 0.0, 3.0])
    programs = iter(["program", "program", "another", "program", "program"])
    monkeypatch.setattr(running, "program", lambda: next(programs))
    out = tmp_path / "out"
    with pytest.raises(RecordingError, match=r"0001\.json: program is another, the run's program; .* of one program"):
        run(default_system, blind_set, out, workers=0, judge=HandJudge())
    with pytest.raises(RecordingError, match=r"0001\.json: program is another"):
        score(blind_set, answers, out)
    (out / "verdicts" / "0001.json").unlink()
    monkeypatch.setattr(running, "program", lambda: "program")
    run(default_system, blind_set, out, workers=0, judge=HandJudge())
    score(blind_set, answers, out)
