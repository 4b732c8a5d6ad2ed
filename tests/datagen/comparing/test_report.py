"""What is in the way of a comparison's report is said before anything is simulated."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from datagen.cli import app
from datagen.comparing.comparison import Comparison
from datagen.comparing.report import PICTURE, draw
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


def _apart(default, bias, systems=1, hours=48):
    """Models whose outputs differ by so much [unit of each] throughout."""
    time = np.tile(3600.0 * np.arange(1, hours + 1), (systems, 1))
    first = np.full((systems, len(default.outputs), hours), 300.0)
    cells = {("regime", "occupied"): np.ones(time.shape, dtype=bool)}
    labels = [str(k) for k in range(systems)]
    return Comparison(("one", "other"), default.outputs, labels, time, first, first + bias, cells)


def test_days_are_counted_from_the_first_of_january(default, tmp_path, monkeypatch):
    """Midnight of 1 January is time zero, so that the first day is day 0."""
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    draw(_apart(default, 1.0), tmp_path / PICTURE)
    first, _, week = drawn[0].axes[:3]
    assert first.lines[0].get_xdata()[0] == 0 and first.get_xlabel() == "days since 1 January"
    assert week.get_xlabel().startswith("days since 1 January (system 0")
