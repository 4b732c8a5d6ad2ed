"""Options that cannot be are refused before a simulator is built, by every command that would simulate for long."""

import pytest

from diagnosis.cli import app
from shared.console import FAULT, USAGE, start

PLACES = ("diagnosis.calibrating.calibration", "diagnosis.forecasting.forecast", "diagnosis.gap.diagnosed")
COMMON = [
    (["--noise", "nosie"], "nosie"),
    (["--out", "taken/below"], "below: nothing can be written there, because"),
    (["--run", "empty"], "empty"),
]


@pytest.fixture
def refused(house, house_recording, tmp_path, monkeypatch, capsys):
    """``refused(command, options)``: what is said and the exit code; fails where a simulator is built."""

    def build(*_, **__):
        raise AssertionError("a simulator was built")

    for place in PLACES:
        monkeypatch.setattr(f"{place}.Simulator", build)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "empty").mkdir()

    def call(command, options):
        out = [] if "--out" in options else ["--out", "out"]
        before = sorted(one.name for one in tmp_path.iterdir())
        code = start(app, [command, str(house("me").path), str(recording), *out, *options])
        assert sorted(one.name for one in tmp_path.iterdir()) == before
        assert (tmp_path / "taken").read_text() == "mine"
        told = capsys.readouterr()
        return code, told.err + told.out

    recording = house_recording(hours=96)
    return call


@pytest.mark.parametrize(("options", "said"), COMMON)
@pytest.mark.parametrize("command", ["calibrate", "forecast", "run"])
def test_before_a_simulator_is_built(refused, command, options, said):
    short = ["--context", "48", "--ahead", "24"] if command == "forecast" else []
    code, told = refused(command, [*short, *options])
    assert code == FAULT and said in told
    assert "simulating" not in told and "fitting" not in told and "Traceback" not in told


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--context", "500"], "is 96 h long; expected at least 836 h: --context"),
        (["--context", "48", "--ahead", "24", "--calibration", "empty"], "calibration.json: no such file"),
    ],
)
def test_a_forecast_says_that_it_is_still_reading(refused, options, said):
    code, told = refused("forecast", options)
    assert code == FAULT and said in told and "reading" in told and "simulating" not in told


@pytest.mark.parametrize("command", ["calibrate", "forecast"])
def test_no_starts_are_wrong_usage(refused, command):
    code, told = refused(command, ["--starts", "0"])
    assert code == USAGE and "reading" not in told and "--starts" in told


@pytest.mark.parametrize("command", ["calibrate", "forecast", "run"])
def test_a_place_without_a_name_is_wrong_usage(refused, command):
    """A shell's variable that is not set would be the folder that one happens to be in."""
    code, told = refused(command, ["--out", ""])
    assert code == USAGE and "reading" not in told and "it is empty; expected a path" in " ".join(told.split())
