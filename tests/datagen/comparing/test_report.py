"""What is in the way of a comparison's report is said before anything is simulated."""

import importlib.util
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from datagen.cli import app
from datagen.comparing.comparison import Comparison
from datagen.comparing.matching import told_apart
from datagen.comparing.report import PICTURE, draw, markdown
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


@pytest.mark.parametrize("bias", [0.0013, -0.0013, 0.00013, 0.013, -0.7, 13.0, -1050.0, 250_000.0, 2.4e6])
def test_labels_of_a_picture_do_not_run_into_each_other(default, tmp_path, monkeypatch, bias):
    drawn, save = [], Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda figure, *a, **b: (save(figure, *a, **b), drawn.append(figure)))
    found = _apart(default, bias, hours=24 * 20)
    alternating = np.where(np.arange(24 * 20) % 2, bias, -0.6 * bias)  # on both sides of zero
    for one in (found, replace(found, second=found.first + alternating)):
        draw(one, tmp_path / PICTURE)
        for axes in drawn[-1].axes:
            low, high = axes.get_xlim()
            shown = [tick.label1 for tick in axes.xaxis.get_major_ticks() if low <= tick.get_loc() <= high]
            boxes = sorted((label.get_window_extent() for label in shown), key=lambda box: box.x0)
            assert len(boxes) >= 2
            assert all(left.x1 + 3 < right.x0 for left, right in pairwise(boxes))


def test_days_are_counted_from_the_first_of_january(default, tmp_path, monkeypatch):
    """Midnight of 1 January is time zero, so that the first day is day 0."""
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    draw(_apart(default, 1.0), tmp_path / PICTURE)
    first, _, week = drawn[0].axes[:3]
    assert first.lines[0].get_xdata()[0] == 0 and first.get_xlabel() == "days since 1 January"
    assert week.get_xlabel().startswith("days since 1 January (system 0")
