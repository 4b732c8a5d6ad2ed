from pathlib import Path

import pytest

from shared.errors import EstimatorError, SystemDescriptionError
from shared.shipped import resolved, resolved_estimator, shipped_estimator, shipped_systems
from shared.system import load_system
from trainer.runs.checkpoint import load_run

ROOT = Path(__file__).resolve().parents[2]


def test_a_name_is_enough_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    system = load_system("MixedAirCO2")
    assert system.hash() == load_system(ROOT / "fmus" / "MixedAirCO2").hash()
    assert system.fmu_path.exists()


def test_a_path_goes_before_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "MixedAirCO2").mkdir()
    assert resolved("MixedAirCO2") == Path("MixedAirCO2")
    assert resolved_estimator("MixedAirCO2") == Path("MixedAirCO2")
    assert resolved("elsewhere/MixedAirCO2") == Path("elsewhere/MixedAirCO2")


def test_an_unknown_name_is_told_what_there_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemDescriptionError, match=r"Hall: no such file; expected .* \(MixedAirCO2, Room\)"):
        load_system("Hall")


def test_a_folder_that_hides_an_estimator_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "MixedAirCO2").mkdir()
    (tmp_path / "other").mkdir()
    shipped = shipped_estimator(Path("MixedAirCO2"))
    assert shipped == shipped_systems()["MixedAirCO2"] / "estimator"
    with pytest.raises(EstimatorError, match=r"hides the estimator of that name; expected .*/MixedAirCO2/estimator$"):
        load_run("MixedAirCO2")
    with pytest.raises(EstimatorError, match=r"^other/estimator\.json: no such file"):
        load_run("other")
    assert load_run(shipped).card.system_name == "MixedAirCO2"


def test_a_system_stands_for_the_estimator_beside_its_description(tmp_path):
    folder = ROOT / "fmus" / "MixedAirCO2"
    assert resolved_estimator(folder) == resolved_estimator(folder / "system.toml") == folder / "estimator"
    assert load_run(folder).folder == folder / "estimator"
    (tmp_path / "estimator").mkdir()  # without a card
    assert resolved_estimator(tmp_path) == tmp_path
