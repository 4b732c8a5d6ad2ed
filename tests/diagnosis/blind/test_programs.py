"""Verdicts of one run are of one program."""

import pytest

import diagnosis.blind.running as running
import diagnosis.blind.working as working
from diagnosis.blind.running import run
from diagnosis.blind.scoring import score
from diagnosis.blind.verdicts import Outcome, Withheld, read_outcome, read_run, write_outcome, write_run, write_withheld
from shared.errors import RecordingError
from tests.diagnosis.blind.blind_cases import Case, HandJudge, hand_set, said, write_results, write_set


def test_a_program_that_changes_while_it_runs_is_noticed(default_system, tmp_path, monkeypatch):
    blind_set, _ = hand_set(tmp_path / "set", default_system, [3.0, 0.0, 3.0])
    programs = iter(["first", "second"])
    monkeypatch.setattr(running, "program", lambda: next(programs))
    with pytest.raises(RecordingError, match="source changed while it ran"):
        run(default_system, blind_set, tmp_path / "out", workers=0, judge=HandJudge())


def test_a_verdict_of_another_program_is_not_one_of_the_run_s(default_system, tmp_path, monkeypatch):
    """Source that was changed and changed back while it ran."""
    blind_set, answers = hand_set(tmp_path / "set", default_system, [3.0, 0.0, 3.0])
    monkeypatch.setattr(running, "program", lambda: "program")
    programs = iter(["program", "another", "program"])
    monkeypatch.setattr(working, "program", lambda: next(programs))
    out = tmp_path / "out"
    with pytest.raises(RecordingError, match=r"0001\.json: program is another, the run's program; .* of one program"):
        run(default_system, blind_set, out, workers=0, judge=HandJudge())
    with pytest.raises(RecordingError, match=r"0001\.json: program is another"):
        score(blind_set, answers, out)
    (out / "verdicts" / "0001.json").unlink()
    monkeypatch.setattr(working, "program", lambda: "program")
    run(default_system, blind_set, out, workers=0, judge=HandJudge())
    score(blind_set, answers, out)


def test_nor_is_one_with_an_effect_withheld(tmp_path):
    ones = [Case("library", ("a",), room=3.0, verdict=said("a"))]
    folder, answers = write_set(tmp_path / "set", ones)
    results = write_results(tmp_path / "results", folder, ones)
    first = read_outcome(results, "recordings/0000.nc")

    def again(program, whole=""):
        write_outcome(results, first.model_copy(update={"program": whole}))
        made = Outcome(file=first.file, sha256=first.sha256, seconds=1.0, verdict=said("b"), program=program)
        write_withheld(results, Withheld(file=first.file, outcomes={"a": made}))
        return score(folder, answers, results).left_out.again

    assert again("any") == 1  # earlier programs did not say which they are
    write_run(results, read_run(results).model_copy(update={"program": "program"}))
    assert again("program", "program") == 1
    with pytest.raises(RecordingError, match=r"program another on recordings/0000\.nc with effects withheld"):
        again("another", "program")
