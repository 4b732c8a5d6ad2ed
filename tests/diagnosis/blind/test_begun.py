"""Where a blind set may be made: nothing is written over, no two calls are at one, and a bad place is told at once."""

import json
import logging

import pytest

import diagnosis.blind.make as module
from diagnosis.blind.make import make
from diagnosis.cli import app
from shared.console import FAULT, start
from shared.errors import RecordingError
from shared.lock import FolderLock


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


@pytest.mark.parametrize("name", ["manifest.json", "recordings/0000.nc"])
def test_a_folder_with_anything_in_it_stays_as_it_is(default_system, tmp_path, written, name):
    """A dataset has a manifest.json, too, and had lost it to the set's."""
    (tmp_path / "data" / name).parent.mkdir(parents=True)
    (tmp_path / "data" / name).write_text('{"schema_version": "2.2"}')
    before = contents(tmp_path)
    with pytest.raises(RecordingError, match=r"data: is not empty; expected a new folder"):
        make(default_system, tmp_path / "data", recordings=1)
    assert contents(tmp_path) == before
    assert written == []


def test_a_call_that_was_stopped_goes_on_only_in_what_it_had_published(default_system, tmp_path, written, monkeypatch):
    stray = "recordings/0000.nc"

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
