"""What is in the way of a comparison's report is said before anything is simulated."""

import pytest

from datagen.cli import app
from datagen.comparing.report import PICTURE
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
