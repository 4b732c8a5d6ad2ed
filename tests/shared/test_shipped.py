from pathlib import Path

import pytest

from shared.errors import SystemDescriptionError
from shared.shipped import resolved, resolved_estimator, shipped_systems
from shared.system import load_system

ROOT = Path(__file__).resolve().parents[2]


def test_the_default_system_comes_with_the_package():
    assert shipped_systems()["MixedAirCO2"].resolve() == (ROOT / "fmus" / "MixedAirCO2").resolve()


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
    with pytest.raises(SystemDescriptionError, match=r"Room: no such file; expected .* \(MixedAirCO2\)"):
        load_system("Room")
