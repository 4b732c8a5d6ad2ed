"""The file that a farm's recordings make: whose it is, and what is refused."""

import json

import pytest

from diagnosis.effects import library
from diagnosis.verdicts import FILE_NAME, candidates_sha256, doubt_of, read_verdicts, verdicts_of
from shared.errors import RecordingError
from shared.shipped import shipped_systems
from tests.diagnosis.verdict_cases import BY


def test_a_system_without_a_file_of_its_own_is_told_whose_probabilities_it_gets(default_system, tmp_path):
    folder = tmp_path / "house"
    folder.mkdir()
    moved = default_system.model_copy(update={"path": folder / "system.toml"})
    effects = library(default_system)
    shipped = read_verdicts(shipped_systems()["MixedAirCO2"] / FILE_NAME)
    assert verdicts_of(default_system, effects, shipped.fmu_sha256, "sensor") == (shipped, "")
    found, why = verdicts_of(moved, effects, "-", "sensor")
    assert found == shipped
    assert "verdict.json is missing" in why
    assert doubt_of(moved) == shipped.doubt
    own = BY.model_copy(update={"system": moved.name})
    (folder / FILE_NAME).write_text(own.model_dump_json(), encoding="utf-8")
    assert verdicts_of(moved, effects, "-", "sensor") == (
        own,
        "verdict.json is of another version of the description, choice of candidates",
    )
    other = own.model_copy(update={"system_hash": moved.hash(), "candidates_sha256": candidates_sha256(effects)})
    (folder / FILE_NAME).write_text(other.model_dump_json(), encoding="utf-8")
    assert verdicts_of(moved, effects, "-", "sensor") == (other, "")
    assert doubt_of(moved) == BY.doubt != shipped.doubt
    assert "FMU, noise preset" in verdicts_of(moved, effects, "+", "clean")[1]
    (folder / FILE_NAME).write_text(other.model_copy(update={"system": "Office"}).model_dump_json(), encoding="utf-8")
    assert verdicts_of(moved, effects, "-", "sensor") == (shipped, "verdict.json is of Office")
    assert doubt_of(moved) == shipped.doubt


def test_a_file_of_something_else_is_refused_by_its_name(tmp_path):
    path = tmp_path / FILE_NAME
    path.write_text(json.dumps(BY.model_dump(mode="json") | {"power": -1.0}), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"verdict\.json: power.*diagnosis farm"):
        read_verdicts(path)


def test_the_shipped_verdict_is_of_the_shipped_system_and_says_what_it_was_worked_out_on(default_system):
    found = read_verdicts(default_system.path.parent / FILE_NAME)
    assert found.system_hash == default_system.hash()
    assert found.strata["none"] >= 25
    assert found.recordings > found.strata["none"]
    assert found.answers.alarms.count == found.strata["none"]
