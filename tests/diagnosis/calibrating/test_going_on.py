"""Calibrations that are stopped, or have no time: what they save, how they go on, and what they say."""

import json
from contextlib import contextmanager

import pytest

from diagnosis.calibrating import calibration
from diagnosis.calibrating.calibration import calibrate
from diagnosis.cli import app
from diagnosis.fitting.simulations import FOLDER, InProcess
from shared.console import FAULT, STOPPED, start
from tests.diagnosis.conftest import WARM_UP

WARM = ["--warm-up", str(WARM_UP)]
SECOND = 1.0 / 60.0
"""In minutes: a simulation takes one second by the clock of these tests."""


class Clocked(InProcess):
    """A second for each simulation; Ctrl-C comes at one of them."""

    made = 0
    interrupted_at = -1

    def map(self, runs):
        """Outcomes, in order."""
        Clocked.made += len(runs)
        if Clocked.made == Clocked.interrupted_at:
            raise KeyboardInterrupt
        return super().map(runs)


@pytest.fixture(scope="module")
def counted():
    """``counted(at)``: from now on simulations are counted, and interrupted at one of them."""

    @contextmanager
    def runner(simulator, **_):
        yield Clocked(simulator)

    def begin(at=-1):
        Clocked.made, Clocked.interrupted_at = 0, at

    with pytest.MonkeyPatch.context() as patched:
        for drawing in ("diagnosis.calibrating.report.embedded", "diagnosis.panels.embedded"):
            patched.setattr(drawing, lambda *_, **__: "no picture")  # which takes longer than the fit
        patched.setattr(calibration, "side_by_side", runner)
        patched.setattr("diagnosis.fitting.simulations.time.monotonic", lambda: float(Clocked.made))
        begin()
        yield begin


def told(folder):
    """The report but for its time."""
    report = json.loads((folder / "calibration.json").read_text())
    del report["seconds"]
    return report


@pytest.fixture(scope="module")
def undisturbed(house, house_recorded, tmp_path_factory, counted):
    """A day of the house, calibrated in one go: its recording, report, and number of simulations."""
    folder = tmp_path_factory.mktemp("undisturbed")
    path = house_recorded(folder, hours=24)
    calibrate(house("me"), path, starts=1, warm_up=WARM_UP, out=folder / "out")
    assert not (folder / "out" / FOLDER).exists()
    return path, told(folder / "out"), Clocked.made


def test_what_is_stopped_goes_on_to_the_same_report_with_fewer_simulations(
    house, undisturbed, tmp_path, counted, capsys
):
    path, report, count = undisturbed
    out = tmp_path / "out"
    words = ["calibrate", str(house("me").path), str(path), "--starts", "1", *WARM, "--out", str(out)]
    counted(at=2 * count // 3)
    assert start(app, words) == STOPPED
    assert "this command continues it" in capsys.readouterr().err
    assert not (out / "calibration.json").exists() and (out / FOLDER).is_dir()
    counted()
    assert start(app, words) == 0
    assert Clocked.made == count - (2 * count // 3 - 1)
    assert told(out) == report
    assert not (out / FOLDER).exists()


def test_when_the_time_is_up_the_last_round_is_the_answer_and_the_same_command_goes_on(
    house, undisturbed, tmp_path, counted, capsys
):
    path, report, count = undisturbed
    out = tmp_path / "out"
    words = ["calibrate", str(house("me").path), str(path), "--starts", "1", *WARM, "--out", str(out), "--minutes"]
    counted()
    assert start(app, [*words, str(5 * SECOND)]) == FAULT
    said = capsys.readouterr()
    assert said.out == "" and "the time was up before there was anything to tell; the same command goes on" in said.err
    counted()
    assert start(app, [*words, str(count * SECOND / 2)]) == 0
    first = told(out)
    assert first["stopped"] and not first["converged"]
    sentence = "The time was up before the fit converged"
    assert sentence in capsys.readouterr().out and sentence in (out / "calibration.html").read_text()
    counted()
    assert start(app, [*words, "60"]) == 0
    assert Clocked.made < count / 2
    assert told(out) == report
