"""What is in the way of a comparison's report is said before anything is simulated."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from datagen.cli import app
from datagen.comparing.comparison import Comparison
from datagen.comparing.matching import told_apart
from datagen.comparing.report import PICTURE, markdown
from shared.console import FAULT, start


@pytest.fixture
def asked(monkeypatch, capsys):
    """``asked(out)``: exit code and sentence of the command, whose simulations would be one too many."""

    def stop(*_, **__):
        raise AssertionError("simulated")

    monkeypatch.setattr("datagen.comparing.comparison.compare", stop)

    def ask(out):
        code = start(app, ["compare", "MixedAirCO2", "MixedAirCO2", "--out", str(out)])
        return code, " ".join("".join(capsys.readouterr()).split())

    return ask


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("file", "file is a file; expected a folder"),
        ("file/below", "file is a file; expected a folder"),
        ("taken", f"{PICTURE}: is a folder; expected none where a file of that name is to be"),
    ],
)
def test_what_is_in_the_way_is_said_before_any_work(asked, tmp_path, name, said):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "taken" / PICTURE).mkdir(parents=True)
    code, text = asked(tmp_path / name)
    assert code == FAULT
    assert said in text
    assert (tmp_path / "file").read_text() == "mine"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["file", "taken"]


def test_a_missing_matplotlib_is_said_before_any_work(asked, tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    code, text = asked(tmp_path)
    assert code == FAULT
    assert f"{PICTURE}: matplotlib is not installed; expected it for the picture" in text


@pytest.mark.parametrize(
    ("other", "names"),
    [
        ({"fmu_path": Path("b/fine.fmu")}, ("room.fmu", "fine.fmu")),
        ({"name": "Fine"}, ("Room", "Fine")),
        ({"path": Path("b/system.toml")}, (str(Path("a/system.toml")), str(Path("b/system.toml")))),
        ({}, ("room.fmu", "room.fmu")),
    ],
)
def test_two_descriptions_of_one_fmu_are_not_told_by_its_name(other, names):
    one = {"fmu_path": Path("a/room.fmu"), "name": "Room", "path": Path("a/system.toml")}
    assert told_apart(SimpleNamespace(**one), SimpleNamespace(**one | other)) == names


def _apart(default, bias, systems=1, hours=48):
    """Models whose outputs differ by so much [unit of each] throughout."""
    time = np.tile(3600.0 * np.arange(1, hours + 1), (systems, 1))
    first = np.full((systems, len(default.outputs), hours), 300.0)
    cells = {("regime", "occupied"): np.ones(time.shape, dtype=bool)}
    labels = [str(k) for k in range(systems)]
    return Comparison(("one", "other"), default.outputs, labels, time, first, first + bias, cells)


@pytest.mark.parametrize(("bias", "written"), [(118.0, "118"), (-118.0, "118"), (1050.0, "1050")])
def test_differences_are_written_without_powers_of_ten(default, monkeypatch, capsys, bias, written):
    found = _apart(default, bias)
    monkeypatch.setattr("datagen.comparing.comparison.compare", lambda *_, **__: found)
    assert start(app, ["compare", "MixedAirCO2", "MixedAirCO2"]) == 0
    sign = "-" if bias < 0 else "+"
    shown = "".join(capsys.readouterr().out.split())
    assert f"{written}({sign}{written})" in shown and "e+" not in shown
    assert f"{sign}{written}, {written}, {written} |" in markdown(found) and "e+" not in markdown(found)


def test_one_system_is_not_told_as_several(default):
    assert [markdown(_apart(default, 1.0, n)).splitlines()[0] for n in (1, 2)] == [
        "`other` minus `one`, 1 system",
        "`other` minus `one`, 2 systems",
    ]
