"""The blind set: sealed, reproducible, and published without a trace of its answers."""

import hashlib
import json
import logging
import shutil

import numpy as np
import pytest
import xarray as xr

import diagnosis.blind.make as module
from diagnosis.blind.generator import Generator
from diagnosis.blind.make import make
from diagnosis.blind.sealed import open_answers, read_manifest
from diagnosis.cli import app
from diagnosis.effects import library
from diagnosis.recording import read_recording
from shared.console import FAULT, start
from shared.errors import RecordingError, SimulationError
from shared.lock import FolderLock
from tests.diagnosis.blind.blind_cases import length_at_once, prepare_quickly


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


def test_a_set_that_is_sealed_and_not_published_is_finished_by_the_same_call(
    default_system, tmp_path, written, monkeypatch
):
    """Only where nothing else lies in its folder, and the answers are those that it would seal."""
    stray, sealed = "recordings/0000.nc", tmp_path / "set.answers.json"

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
    made = sealed.read_bytes()
    sealed.write_bytes(made.replace(b'"salt":', b'"pepper":'))
    with pytest.raises(RecordingError, match=r"expected a new f(ile for the answers|older)$"):
        make(default_system, tmp_path / "set", recordings=2)
    sealed.write_bytes(made)
    make(default_system, tmp_path / "set", recordings=2)
    assert written == [0, 1]
    assert contents(tmp_path / "set") == {**kept, "manifest.json": contents(tmp_path / "set")["manifest.json"]}
    assert sealed.read_bytes() == made
    assert sorted(path.name for path in tmp_path.iterdir()) == ["set", "set.answers.json"]
    with pytest.raises(RecordingError, match="holds a blind set; expected a new folder"):
        make(default_system, tmp_path / "set", recordings=2)
    with pytest.raises(RecordingError, match="which is published"):
        make(default_system, tmp_path / "x", answers=tmp_path / "x" / "a.json", recordings=1)


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


def test_recordings_that_no_diagnosis_would_read_are_not_made(tmp_path, capsys):
    assert start(app, ["blind", "make", str(tmp_path / "set"), "--recordings", "1", "--hours", "23"]) == FAULT
    assert "hours is 23; expected at least 24" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


HOURS, SEED, COUNT = 72.0, 20, 4


@pytest.fixture(scope="module", autouse=True)
def quick():
    """Lengths beyond imitation are something else, in the processes that are started too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("diagnosis.blind.make.detectability", length_at_once)
        patch.setattr("diagnosis.blind.make._prepare", prepare_quickly)
        yield


@pytest.fixture(scope="module")
def system(default_system):
    """The default system with two days before each record: nothing here depends on how settled a room is."""
    experiment = default_system.experiment.model_copy(update={"warm_up_hours": 48.0})
    return default_system.model_copy(update={"experiment": experiment})


@pytest.fixture(scope="module")
def blind_set(system, tmp_path_factory):
    """Folder, sealed file."""
    folder = tmp_path_factory.mktemp("blind") / "set"
    make(system, folder, recordings=COUNT, seed=SEED, hours=HOURS)
    return folder, folder.with_name("set.answers.json")


@pytest.fixture(scope="module")
def answers(blind_set):
    return open_answers(*blind_set)


def test_hash_is_published_and_holds(blind_set, answers, tmp_path):
    folder, sealed = blind_set
    manifest = read_manifest(folder)
    assert manifest["answers_sha256"] == hashlib.sha256(sealed.read_bytes()).hexdigest()
    assert len(answers["salt"]) == 64
    forged = tmp_path / "forged.json"
    raw = json.loads(sealed.read_text())
    raw["recordings"][0]["verdict"] = "none_of_these"
    forged.write_text(json.dumps(raw))
    with pytest.raises(RecordingError, match=r"forged\.json: sha256 is .*; expected .*, as published"):
        open_answers(folder, forged)
    copy = tmp_path / "set"
    shutil.copytree(folder, copy)
    first = copy / manifest["recordings"][0]["file"]
    content = first.read_bytes()
    first.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    with pytest.raises(RecordingError, match=r"0000\.nc: missing or changed since it was published"):
        open_answers(copy, sealed)


def test_nothing_but_recordings_and_their_conditions_is_published(blind_set, answers, system, truth):
    folder, sealed = blind_set
    assert sorted(contents(folder)) == ["manifest.json", *(f"recordings/{k:04}.nc" for k in range(COUNT))]
    assert folder not in sealed.parents
    assert not sealed.with_name(f"{sealed.name}.part").exists()
    manifest = read_manifest(folder)
    assert set(manifest) == {
        "schema", "system_name", "system_hash", "fmu_sha256", "uncertain_sha256", "step", "hours", "answers_sha256",
        "recordings",
    }  # fmt: skip
    assert all(set(one) == {"file", "sha256", "occupancy", "replay"} for one in manifest["recordings"])
    words = [effect.name for effect in library(system)] + [form.name for form in truth.forms]
    words += ["stratum", "amplitude", "salt", str(answers["seed"]), answers["salt"]]
    for file, content in contents(folder).items():
        for word in words:
            if word.isdigit() and len(word) < 6:
                continue  # a short number is in any file
            known = word in {"plug", "mixing", "clock", "bridge", "glare"}
            assert word.encode() not in content or known, (file, word)


def test_size_attributes_order_and_times_follow_the_public_conditions_alone(blind_set, answers):
    """Two recordings of the same conditions cannot be told apart but by their values."""
    folder, _ = blind_set
    looks: dict[tuple, set] = {}
    stamps = set()
    for answer in answers["recordings"]:
        path = folder / answer["file"]
        data = xr.load_dataset(path, decode_times=False)
        look = (
            path.stat().st_size,
            tuple(data.variables),
            json.dumps(data.attrs),
            json.dumps([{k: str(v) for k, v in one.attrs.items()} for one in data.variables.values()]),
            tuple(str(one.dtype) for one in data.variables.values()),
        )
        looks.setdefault((answer["occupancy"], answer["replay"]), set()).add(look)
        stamps.add((path.stat().st_mtime, path.stat().st_mode))
    assert len(looks) < len(answers["recordings"])  # some have the same conditions
    assert all(len(found) == 1 for found in looks.values())
    assert len(stamps) == 1
    assert len({answer["stratum"] for answer in answers["recordings"]}) > 2


def test_recordings_can_be_read_and_hold_what_was_measured(blind_set, answers, system):
    folder, _ = blind_set
    for answer in answers["recordings"]:
        record = read_recording(folder / answer["file"], system)
        assert len(record.time) == HOURS
        assert record.start == answer["start"]
        assert ("nPer" in record.inputs) == (answer["occupancy"] == "measured")
        assert ("TSet" in record.inputs) == (not answer["replay"])
        clean = np.array(list(answer["clean"].values()))
        noise = record.outputs - clean
        for k, output in enumerate(system.outputs):
            assert np.nanstd(noise[k]) == pytest.approx(output.noise["sensor"].sd, rel=0.5)
        assert 0 < np.isnan(record.outputs).mean() < 0.05


def test_the_same_seed_gives_the_same_bytes_in_any_order_and_after_an_interruption(
    blind_set, system, tmp_path, monkeypatch
):
    folder, sealed = blind_set
    again = tmp_path / "again"
    written, write_one = [], module.write_one

    def stopped(generator, seed, index, part):
        if len(written) == 3:
            raise KeyboardInterrupt
        written.append(index)
        write_one(generator, seed, index, part)

    monkeypatch.setattr(module, "write_one", stopped)
    with pytest.raises(KeyboardInterrupt):
        make(system, again, recordings=COUNT, seed=SEED, hours=HOURS)
    assert not again.exists()  # nothing is published before all is made
    monkeypatch.undo()
    with pytest.raises(RecordingError, match="begun with other settings"):
        make(system, again, recordings=COUNT, seed=SEED + 1, hours=HOURS)
    make(system, again, recordings=COUNT, hours=HOURS)
    assert contents(again) == contents(folder)
    assert again.with_name("again.answers.json").read_bytes() == sealed.read_bytes()


def test_what_cannot_be_simulated_is_drawn_anew_and_counted(answers, system, tmp_path, monkeypatch):
    failed = []

    def fails_late(_, path, answer, *__):
        if path.name == "1.nc" and answer["attempt"] < 2:
            failed.append(answer)
            raise SimulationError("stiff")
        return length_at_once(_, path, answer)

    monkeypatch.setattr("diagnosis.blind.make.detectability", fails_late)
    make(system, tmp_path / "set", recordings=2, seed=SEED, hours=HOURS)
    assert len(failed) == 2
    before = answers["recordings"][:2]
    after = open_answers(tmp_path / "set", tmp_path / "set.answers.json")["recordings"]
    assert after[0] == before[0]
    assert [one["attempt"] for one in after] == [0, 2]
    assert after[1]["stratum"] == before[1]["stratum"]
    assert [one["effect"] for one in after[1]["causes"]] == [one["effect"] for one in before[1]["causes"]]
    for drawn in ("parameters", "constants", "start"):
        assert after[1][drawn] != before[1][drawn]
    read_recording(tmp_path / "set" / after[1]["file"], system)


def test_a_recording_that_no_draw_can_make_is_told(system, tmp_path, monkeypatch):
    def fails(self, case):
        raise SimulationError(f"stiff at {case.attempt}")

    monkeypatch.setattr(Generator, "make_case", fails)
    expected = r"truth\.toml: recording 0 of this seed .* none of its 5 draws; .* draw: stiff at 4"
    with pytest.raises(SimulationError, match=expected):
        make(system, tmp_path / "set", recordings=1, seed=SEED, hours=48.0)


@pytest.mark.slow
def test_a_process_apart_makes_the_same(blind_set, system, tmp_path):
    """And a set of other length has the same recordings: each depends on the seed and its number alone."""
    folder, _ = blind_set
    make(system, tmp_path / "one", recordings=1, seed=SEED, hours=HOURS, workers=2)
    file = "recordings/0000.nc"
    assert (tmp_path / "one" / file).read_bytes() == (folder / file).read_bytes()
