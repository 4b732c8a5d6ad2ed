"""A blind run with candidates withheld: what was stopped or failed is told, and goes on."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

import diagnosis.blind.running as running
from diagnosis.blind.running import contenders, run
from diagnosis.blind.verdicts import Verdict, read_withheld
from diagnosis.cli import app
from shared.console import OK, PARTLY, start
from tests.diagnosis.blind.blind_cases import HandJudge, files, one_after_another

pytestmark = pytest.mark.usefixtures("one_program")


def test_leave_one_out_withholds_what_had_a_chance_and_comes_after(blind_set, default_system, tmp_path):
    out = tmp_path / "out"
    run(default_system, blind_set, out, workers=0, judge=HandJudge())
    kept = [(out / "verdicts" / f"{k:04}.json").read_bytes() for k in range(3)]
    run(default_system, blind_set, out, workers=0, judge=HandJudge(), leave_one_out=True)
    assert kept == [(out / "verdicts" / f"{k:04}.json").read_bytes() for k in range(3)]
    again = read_withheld(out, "recordings/0000.nc")
    assert {name: one.answer for name, one in again.outcomes.items()} == {"a": "none_of_these", "b": "none_of_these"}
    assert read_withheld(out, "recordings/0001.nc").outcomes == {}  # no gap: no candidate had a chance


class Stopped(HandJudge):
    """Is stopped when it comes to the second candidate; notes what it is asked to do without."""

    def __call__(self, recording, *, replay, occupancy):
        spoken = super().__call__(recording, replay=replay, occupancy=occupancy)
        return SimpleNamespace(verdict=spoken.verdict, without=lambda name: self.do_without(spoken, name))

    def do_without(self, spoken, name):
        (self.asked / f"without {name}").touch()
        if name == "b":
            raise KeyboardInterrupt
        return spoken.without(name)


@pytest.fixture
def stopped(blind_set, tmp_path):
    """A job that was stopped between its two candidates."""
    (tmp_path / "asked").mkdir()
    listed = json.loads((blind_set / "manifest.json").read_text())["recordings"][0]
    job = running.Job(Stopped(tmp_path / "asked"), blind_set, tmp_path / "out", listed, leave_one_out=True)
    with pytest.raises(KeyboardInterrupt):
        running.work(job)
    assert read_withheld(job.results, "recordings/0000.nc") is None  # no score takes it for whole
    return job


def test_a_recording_that_was_stopped_goes_on_with_the_candidates_that_are_left(stopped):
    reached = json.loads((stopped.results / "without" / "0000.part").read_text())["outcomes"]["a"]
    running.work(replace(stopped, judge=HandJudge()))
    again = read_withheld(stopped.results, "recordings/0000.nc").outcomes
    assert (list(again), again["b"].answer) == (["a", "b"], "none_of_these")
    assert again["a"].model_dump(mode="json") == reached  # how long it took, too
    assert files(stopped.results) == ["verdicts/0000.json", "without/0000.json"]


def test_a_diagnosis_that_fails_with_an_effect_withheld_is_told(
    blind_set, default_system, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(running, "Diagnoser", lambda *_: HandJudge(breaks=("a",)))
    monkeypatch.setattr(running, "_side_by_side", one_after_another)
    words = ["blind", "run", str(default_system.path), str(blind_set), "--out", str(tmp_path / "out")]
    assert start(app, words) == OK
    capsys.readouterr()
    assert start(app, [*words, "--leave-one-out"]) == PARTLY
    told = capsys.readouterr()
    assert "4 diagnosed again without a candidate, 2 failed" in told.out  # a and b, of two recordings
    said = "0000.nc failed without a, the first of 2: ValueError: cannot do without a"
    assert said in " ".join(told.err.split())
    assert start(app, [*words, "--leave-one-out", "--json"]) == PARTLY
    told = json.loads(capsys.readouterr().out)
    assert (told["withheld"], told["withheld_failed"]) == (4, 2)


def test_what_every_candidate_has_alike_is_no_reason_to_diagnose_again():
    """Of four candidates the evidence points to one; that it is mistaken gives each of them five per cent more."""
    said = {"a": 0.55, "b": 0.05, "c": 0.05, "d": 0.07}
    one = Verdict(verdict="effect", probabilities=said, none=0.25, nothing=0.04, mistaken=0.49, named=["a"])
    assert one.pointed == pytest.approx({"a": 0.5, "b": 0.0, "c": 0.0, "d": 0.02})
    assert contenders(one) == ["a", "d"]
    rejected = {"verdict": "none_of_these", "named": [], "chosen": ["b"], "mistaken": 0.6}
    assert contenders(one.model_copy(update=rejected)) == ["a", "b", "d"]  # its fit is what was rejected
