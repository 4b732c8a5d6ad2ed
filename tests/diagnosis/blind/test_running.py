"""Running a blind set: it reads the recordings only, goes on where it stopped, and loses no recording that fails."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import diagnosis.blind.running as running
from diagnosis.blind.make import make
from diagnosis.blind.running import run
from diagnosis.blind.scoring import score
from diagnosis.blind.sealed import open_answers
from diagnosis.blind.verdicts import read_outcome, read_run, read_withheld
from diagnosis.cli import app
from shared.console import FAULT, OK, PARTLY, STOPPED, start
from shared.errors import RecordingError, SystemDescriptionError
from shared.store import sha256_of
from tests.diagnosis.blind.blind_cases import HandJudge, files, hand_set, one_after_another

pytestmark = pytest.mark.usefixtures("one_program")


def answers_of(results, count=3):
    return [read_outcome(results, f"recordings/{k:04}.nc").answer for k in range(count)]


def test_one_verdict_for_each_recording_and_what_is_there_is_not_made_again(blind_set, default_system, tmp_path):
    """With its public conditions; one that fails has an outcome."""
    asked, told, out = tmp_path / "asked", [], tmp_path / "out"
    asked.mkdir()
    made = run(
        default_system, blind_set, out, workers=0, judge=HandJudge(asked), progress=lambda *one: told.append(one)
    )
    assert files(out) == ["run.json", *(f"verdicts/{k:04}.json" for k in range(3))]
    assert answers_of(out) == ["effect", "no_gap", "effect"]
    assert sorted(path.read_text() for path in asked.iterdir()) == ["False measured", "False measured", "True measured"]
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert read_run(out) == made
    assert made.library == [one.name for one in default_system.effects]
    (out / "verdicts" / "0001.json").unlink()
    kept = (out / "verdicts" / "0000.json").read_bytes()
    run(default_system, blind_set, out, workers=0, judge=HandJudge(asked, fails=("0001",)))
    assert sorted(path.stem for path in asked.iterdir()) == ["0000", "0001", "0001", "0002"]
    assert (out / "verdicts" / "0000.json").read_bytes() == kept
    failed = read_outcome(out, "recordings/0001.nc")
    assert (failed.answer, failed.failure) == ("failed", "ValueError: cannot judge this")


def test_another_run_of_the_same_folder_is_refused(blind_set, default_system, tmp_path, monkeypatch):
    out = tmp_path / "out"
    run(default_system, blind_set, out, workers=0, judge=HandJudge())
    name = default_system.effects[0].name
    with pytest.raises(RecordingError, match="library was"):
        run(default_system, blind_set, out, workers=0, judge=HandJudge(), without=[name])
    with pytest.raises(RecordingError, match="settings was"):
        run(default_system, blind_set, out, workers=0, judge=HandJudge(), seed=1)
    larger = default_system.effects[0].model_copy(update={"scale": 2 * default_system.effects[0].scale})
    other = default_system.model_copy(update={"effects": [larger, *default_system.effects[1:]]})
    with pytest.raises(RecordingError, match=r"settings was .*declared"):
        run(other, blind_set, out, workers=0, judge=HandJudge())
    monkeypatch.setattr(running, "program", lambda: "another")
    with pytest.raises(RecordingError, match="program was 'program'; expected 'another'"):
        run(default_system, blind_set, out, workers=0, judge=HandJudge())


def test_a_program_that_changes_while_it_runs_is_noticed(blind_set, default_system, tmp_path, monkeypatch):
    programs = iter(["first", "first", "first", "first", "second"])  # of the run, of each verdict, of the run's end
    monkeypatch.setattr(running, "program", lambda: next(programs))
    with pytest.raises(RecordingError, match="source changed while it ran"):
        run(default_system, blind_set, tmp_path / "out", workers=0, judge=HandJudge())


def test_a_verdict_of_another_program_is_not_one_of_the_run_s(default_system, tmp_path, monkeypatch):
    """Source that was changed and changed back while it ran."""
    blind_set, answers = hand_set(tmp_path / "set", default_system, [3.0, 0.0, 3.0])
    programs = iter(["program", "program", "another", "program", "program"])
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(running, "program", lambda: next(programs))
        said = r"0001\.json: program is another, the run's program; .* of one program"
        with pytest.raises(RecordingError, match=said):
            run(default_system, blind_set, out, workers=0, judge=HandJudge())
    with pytest.raises(RecordingError, match=r"0001\.json: program is another"):
        score(blind_set, answers, out)
    (out / "verdicts" / "0001.json").unlink()
    run(default_system, blind_set, out, workers=0, judge=HandJudge())
    score(blind_set, answers, out)


@pytest.mark.parametrize("limit", [0.0, float("nan")])
def test_a_run_without_time_is_refused(blind_set, default_system, tmp_path, limit):
    with pytest.raises(RecordingError, match=r"limit is \S+ s; expected more than 0"):
        run(default_system, blind_set, tmp_path / "out", workers=0, judge=HandJudge(), limit=limit)
    assert not (tmp_path / "out").exists()


def test_sets_of_another_system_and_changed_recordings_are_refused(blind_set, default_system, house, tmp_path):
    with pytest.raises(RecordingError, match="system_hash is"):
        run(house("me"), blind_set, tmp_path / "out", workers=0, judge=HandJudge())
    with pytest.raises(SystemDescriptionError, match="'ghost' is withheld but no effect"):
        run(default_system, blind_set, tmp_path / "out", without=["ghost"])
    (blind_set / "recordings" / "0002.nc").write_bytes(b"other")
    with pytest.raises(RecordingError, match=r"0002\.nc: missing or changed since it was published"):
        run(default_system, blind_set, tmp_path / "out", workers=0, judge=HandJudge())
    assert not (tmp_path / "out").exists()


def test_an_estimator_that_is_none_is_told_before_a_folder_is_begun(blind_set, default_system, tmp_path, capsys):
    """Every recording had failed for it, and the folder could not be used again without it."""
    out = tmp_path / "out"
    words = ["blind", "run", str(default_system.path), str(blind_set), "--out", str(out)]
    assert start(app, [*words, "--run", str(tmp_path / "nowhere")]) == FAULT
    assert "nowhere" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.slow
def test_processes_that_die_or_hang_lose_one_recording_each(blind_set, default_system, tmp_path, monkeypatch):
    monkeypatch.setattr(running, "check_program", lambda *_: None)  # each process finds the program that there is
    judge = HandJudge(dies=("0001",), hangs=("0002",))
    run(default_system, blind_set, tmp_path / "out", workers=2, judge=judge, limit=20.0, leave_one_out=True)
    assert answers_of(tmp_path / "out") == ["effect", "failed", "failed"]
    assert read_outcome(tmp_path / "out", "recordings/0001.nc").failure == "its process ended with code 17"
    assert "longer than 20 s" in read_outcome(tmp_path / "out", "recordings/0002.nc").failure
    assert set(read_withheld(tmp_path / "out", "recordings/0000.nc").outcomes) == {"a", "b"}
    assert read_withheld(tmp_path / "out", "recordings/0001.nc").outcomes == {}


STOPPED_RUN = """
import sys
import diagnosis.blind.running as running
from diagnosis.cli import app
from shared.console import start
from tests.diagnosis.blind.blind_cases import HandJudge
running.program = lambda: "program"
running.check_program = lambda *_: None  # workers do not know this one
running.Diagnoser = lambda *_: HandJudge(hangs=("0001",))
sys.exit(start(app, sys.argv[1:]))
"""


@pytest.mark.slow
def test_ctrl_c_fails_no_recording_and_says_how_to_go_on(default_system, tmp_path, monkeypatch):
    """The terminal sends it to every process of the run; it is no failure of the recording under way."""
    folder, _ = hand_set(tmp_path / "set", default_system, [3.0, 0.0])
    words = ["blind", "run", str(default_system.path), str(folder), "--out", str(tmp_path / "out"), "--workers", "2"]
    root = Path(__file__).resolve().parents[3]
    settings = {"cwd": root, "env": {**os.environ, "PYTHONPATH": str(root)}, "text": True}
    child = subprocess.Popen(
        [sys.executable, "-c", STOPPED_RUN, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **settings,
    )
    for _ in range(6000):
        if (tmp_path / "out" / "verdicts" / "0000.json").exists():
            break
        assert child.poll() is None, child.communicate()
        time.sleep(0.05)
    time.sleep(0.5)
    os.killpg(child.pid, signal.SIGINT)
    _, err = child.communicate(timeout=60)
    assert child.returncode == STOPPED
    assert "Traceback" not in err
    assert err.splitlines()[-1] == f"  diagnosis {shlex.join(words)}"
    assert files(tmp_path / "out") == ["run.json", "verdicts/0000.json"]
    monkeypatch.setattr(running, "Diagnoser", lambda *_: HandJudge())
    monkeypatch.setattr(running, "_side_by_side", one_after_another)
    monkeypatch.setattr(running, "check_program", lambda *_: None)
    assert start(app, words) == OK
    assert answers_of(tmp_path / "out", 2) == ["effect", "no_gap"]


OPENED = """
import json, sys
from pathlib import Path
opened = []
sys.addaudithook(lambda name, args: opened.append(str(args[0])) if name == "open" else None)
from diagnosis.blind.running import run
from tests.diagnosis.blind.blind_cases import HandJudge
run(*sys.argv[1:4], workers=0, judge=HandJudge(), leave_one_out=True)
print(json.dumps(opened))
"""


def test_a_run_opens_the_recordings_and_their_manifest_only(blind_set, default_system, tmp_path):
    """Beside them lie the answers and what else might tell; the verdicts are the same whether they do or not."""
    decoys = ["set.answers.json.part", "answers.json", "set/answers.json", "set/recordings/0000.json"]
    for decoy in decoys:
        (tmp_path / decoy).write_text("{}")
    words = [str(default_system.path), str(blind_set), str(tmp_path / "out")]
    root = Path(__file__).resolve().parents[3]
    made = subprocess.run(
        [sys.executable, "-c", OPENED, *words], capture_output=True, text=True, check=True, cwd=root,
        env={**os.environ, "PYTHONPATH": str(root)},
    )  # fmt: skip
    opened = {Path(one) for one in json.loads(made.stdout.splitlines()[-1])}
    inside = {path.relative_to(tmp_path).as_posix() for path in opened if tmp_path in path.parents}
    read = {one for one in inside if not one.startswith("out/")}
    assert read == {"set/manifest.json", *(f"set/recordings/{k:04}.nc" for k in range(3))}
    for decoy in [*decoys, "set.answers.json"]:
        (tmp_path / decoy).unlink()
    run(default_system, blind_set, tmp_path / "alone", workers=0, judge=HandJudge(), leave_one_out=True)
    assert said(tmp_path / "alone") == said(tmp_path / "out")


def said(results):
    """All verdicts, without how long they took and which program said them."""
    found = {}
    for path in sorted(results.rglob("0*.json")):
        text = path.read_text()
        apart = ("seconds", '"program"')
        found[path.parent.name, path.name] = [
            line for line in text.splitlines() if not any(word in line for word in apart)
        ]
    return found


def test_commands(blind_set, default_system, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(running, "Diagnoser", lambda *_: HandJudge())
    monkeypatch.setattr(running, "_side_by_side", one_after_another)
    words = ["blind", "run", str(default_system.path), str(blind_set), "--out", str(tmp_path / "out"), "--workers", "2"]
    assert start(app, [*words, "--json"]) == OK
    told = json.loads(capsys.readouterr().out)
    assert (told["recordings"], told["verdicts"]) == (3, {"effect": 2, "no_gap": 1})
    monkeypatch.setattr(running, "Diagnoser", lambda *_: HandJudge(fails=("0001", "0002")))
    assert start(app, [*words[:5], str(tmp_path / "partly"), *words[6:]]) == PARTLY
    told = told | {"partly": capsys.readouterr()}
    assert "2 failed" in told["partly"].out
    assert "0001.nc failed, the first of 2: ValueError: cannot judge this" in told["partly"].err.replace("\n", " ")
    answers, page = tmp_path / "set.answers.json", tmp_path / "score.html"
    words = ["blind", "score", str(blind_set), str(answers), str(tmp_path / "out"), "--out", str(page)]
    assert start(app, [*words, "--json"]) == OK
    scored = json.loads(capsys.readouterr().out)
    assert scored["verdicts_sha256"] == told["verdicts_sha256"]
    assert scored["answers_sha256"] == sha256_of(answers)
    assert (scored["answers"]["library"]["effect"], scored["answers"]["library"]["no_gap"]) == (2, 1)
    assert page.exists()


@pytest.mark.slow
def test_the_diagnosis_itself_judges_a_set_whose_answers_lie_elsewhere(default_system, tmp_path):
    """End to end on one short recording with few candidates and parameters; meanwhile there are no answers here."""
    withheld = [one.name for one in default_system.effects[3:]]
    known = {one.name: float(one.from_unit(0.5)) for one in default_system.parameters[3:]}
    few = {"parameters": default_system.parameters[:3], "fixed": default_system.fixed | known, "uncertain": []}
    system = default_system.model_copy(update=few)
    make(system, tmp_path / "set", recordings=1, seed=8, hours=24.0)
    (made,) = open_answers(tmp_path / "set", tmp_path / "set.answers.json")["recordings"]
    assert made["detectability"]["length"] > 0.0
    answers = (tmp_path / "set.answers.json").read_bytes()
    (tmp_path / "set.answers.json").unlink()
    run(system, tmp_path / "set", tmp_path / "out", workers=0, without=withheld)
    outcome = read_outcome(tmp_path / "out", "recordings/0000.nc")
    assert outcome.failure == ""
    assert outcome.verdict is not None
    assert set(outcome.verdict.parameters) == set(system.parameter_names)
    (tmp_path / "set.answers.json").write_bytes(answers)
    done = score(tmp_path / "set", tmp_path / "set.answers.json", tmp_path / "out", out=tmp_path / "score.html")
    assert done.recordings == 1
    assert not done.failures
