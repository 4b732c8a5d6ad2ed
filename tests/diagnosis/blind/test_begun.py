"""Where a blind set may be made: nothing is written over, no two calls are at one, and a bad place is told at once."""

import json
import logging

import pytest

import diagnosis.blind.make as module
from diagnosis.blind.begun import begin
from diagnosis.blind.make import make
from diagnosis.cli import app
from shared.console import FAULT, USAGE, start
from shared.errors import RecordingError
from shared.lock import FolderLock
from tests.diagnosis.blind.blind_cases import Case, write_set


@pytest.fixture
def written(monkeypatch):
    """The numbers of recordings that were made; files and answers say next to nothing."""
    made = []

    def write_one(generator, seed, index, part):
        made.append(index)
        (part / f"{index}.nc").write_bytes(b"of this set")
        (part / f"{index}.json").write_text(json.dumps({"occupancy": "measured", "replay": False}))

    monkeypatch.setattr(module, "write_one", write_one)
    monkeypatch.setattr(module, "Generator", lambda *_, **__: None)
    return made


def contents(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", ["manifest.json", "shards/0.nc", "recordings/0000.nc", "notes.txt"])
def test_a_folder_with_anything_in_it_stays_as_it_is(default_system, tmp_path, written, name):
    """A dataset has a manifest.json, too, and had lost it to the set's."""
    (tmp_path / "data" / name).parent.mkdir(parents=True)
    (tmp_path / "data" / name).write_text('{"schema_version": "2.2"}')
    before = contents(tmp_path)
    with pytest.raises(RecordingError, match=r"data: is not empty; expected a new folder"):
        make(default_system, tmp_path / "data", recordings=1)
    assert contents(tmp_path) == before
    assert written == []


def test_a_set_of_other_answers_is_not_written_over_at_the_end_either(default_system, tmp_path, written, monkeypatch):
    """Two calls with one folder and an answers' file each: the later one had mixed its recordings into the other's."""
    sealed = module.seal

    def published_meanwhile(path, answers):
        write_set(tmp_path / "set", [Case("library", ("a",))])
        return sealed(path, answers)

    monkeypatch.setattr(module, "seal", published_meanwhile)
    with pytest.raises(RecordingError, match=r"set: holds a blind set; expected a new folder"):
        make(default_system, tmp_path / "set", recordings=1, answers=tmp_path / "mine.json")
    assert contents(tmp_path / "set")["recordings/0000.nc"] != b"of this set"
    assert (tmp_path / "mine.json.part").is_dir()  # what was made is kept


@pytest.mark.parametrize("stray", ["notes.txt", "recordings/0000.nc"])
def test_a_call_that_was_stopped_goes_on_only_in_what_it_had_published(
    default_system, tmp_path, written, monkeypatch, stray
):
    def stopped(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(module, "publish", stopped)
        make(default_system, tmp_path / "set", recordings=2)
    kept = contents(tmp_path / "set")
    (tmp_path / "set" / stray).write_text("somebody else's")
    with pytest.raises(RecordingError, match=r"set: is not empty; expected a new folder"):
        make(default_system, tmp_path / "set", recordings=2)
    (tmp_path / "set" / stray).unlink()
    make(default_system, tmp_path / "set", recordings=2)
    assert written == [0, 1]
    assert contents(tmp_path / "set") == {**kept, "manifest.json": contents(tmp_path / "set")["manifest.json"]}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set", "set.answers.json"]


def test_two_calls_are_not_at_one_set(default_system, tmp_path, written):
    """They had drawn a seed each, and the answers were of other rooms than the recordings."""
    part = tmp_path / "set.answers.json.part"
    part.mkdir()
    with FolderLock(part), pytest.raises(RecordingError, match=r"set\.answers\.json\.part: another run is at it"):
        make(default_system, tmp_path / "set", recordings=1)
    assert written == []
    assert [path.name for path in part.iterdir()] == [".lock"]
    make(default_system, tmp_path / "set", recordings=1)
    assert not part.exists()


def test_the_lock_is_held_from_before_the_seed_is_drawn_until_the_set_is_published(
    default_system, tmp_path, written, monkeypatch
):
    def taken():
        with pytest.raises(RecordingError, match="another run is at it"):
            make(default_system, tmp_path / "set", recordings=1)
        asked.append(True)

    def begun(*given):
        taken()
        return begin(*given)

    def published(*given):
        taken()
        return publish(*given)

    asked, publish = [], module.publish
    monkeypatch.setattr(module, "begin", begun)
    monkeypatch.setattr(module, "publish", published)
    make(default_system, tmp_path / "set", recordings=1)
    assert asked == [True, True]


@pytest.mark.parametrize("where", ["out", "answers"])
def test_a_place_that_is_a_file_is_told_before_anything_is_made(default_system, tmp_path, written, where):
    (tmp_path / "file").write_text("here already")
    out, answers = (tmp_path / "file", None) if where == "out" else (tmp_path / "set", tmp_path / "file" / "a.json")
    with pytest.raises(RecordingError, match=r"nothing can be written there, because .*file is a file"):
        make(default_system, out, recordings=1, answers=answers)
    assert contents(tmp_path) == {"file": b"here already"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]
    assert written == []


def test_the_log_is_not_published(default_system, tmp_path, written, capsys):
    """Its first line is the command, with the seed."""
    (tmp_path / "set").mkdir()
    words = ["blind", "make", str(tmp_path / "set"), "--recordings", "1", "--log", str(tmp_path / "set" / "log.jsonl")]
    try:
        assert start(app, words) == FAULT
    finally:
        logging.getLogger("zeroshot").handlers.clear()
    assert "log.jsonl: lies in" in capsys.readouterr().err.replace("\n", " ")
    assert written == []


@pytest.mark.parametrize("hours", ["5", "23"])
def test_recordings_that_no_diagnosis_would_read_are_not_made(tmp_path, capsys, hours):
    assert start(app, ["blind", "make", str(tmp_path / "set"), "--recordings", "1", "--hours", hours]) == FAULT
    assert f"hours is {hours}; expected at least 24" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_nor_are_those_of_fewer_steps_than_a_diagnosis_takes(default_system, tmp_path, written):
    coarse = default_system.with_experiment(step=12 * 3600.0)
    with pytest.raises(RecordingError, match=r"hours is 24; expected at least 48: .* a day or than 4 steps"):
        make(coarse, tmp_path / "set", recordings=1, hours=24.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["make", "run"])
@pytest.mark.parametrize("workers", ["0", "-1"])
def test_workers_that_there_cannot_be_are_wrong_usage(tmp_path, capsys, command, workers):
    """Everything was done in the process itself, where no limit ends a recording that hangs."""
    words = {"make": [str(tmp_path / "set")], "run": ["MixedAirCO2", str(tmp_path), "--out", str(tmp_path / "out")]}
    assert start(app, ["blind", command, *words[command], "--workers", workers]) == USAGE
    assert "--workers" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
