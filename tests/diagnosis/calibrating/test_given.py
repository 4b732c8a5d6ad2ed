"""A calibration that was made before, used again: residuals of its own recording and of other days."""

import json

import numpy as np
import pytest

from diagnosis import calibrate, residuals
from diagnosis.calibrating.report import write_calibration
from diagnosis.cli import app
from shared.console import FAULT, OK, start
from tests.diagnosis.conftest import WARM_UP


def test_residuals_with_a_calibration_are_its_own_figures_and_carry_to_days_that_it_has_not_seen(
    calibrated, house, house_recorded, tmp_path, capsys
):
    system, report = house("me"), calibrated.report
    write_calibration(calibrated, tmp_path)
    words = ["residuals", str(system.path), report.recording, "--calibration", str(tmp_path)]
    words += ["--warm-up", str(WARM_UP), "--json"]
    assert start(app, words) == OK
    found = json.loads(capsys.readouterr().out)
    assert found["parameters"] == {one.name: one.value for one in report.parameters}
    assert found["outputs"]["room"]["rmse"] == pytest.approx(report.outputs["room"].rmse, rel=2e-3)
    other = house_recorded(tmp_path, hours=48, seed=1)
    left = residuals(system, other, calibration=report, warm_up=WARM_UP).outputs["room"]["rmse"]
    assert left < 0.1  # of 0.05 K of noise
    middle = {one.name: float(one.from_unit(0.5)) for one in system.parameters}
    assert residuals(system, other, parameters=middle, warm_up=WARM_UP).outputs["room"]["rmse"] > 5 * left
    assert start(app, [*words, "--set", "ro=3"]) == FAULT
    assert "calibration is given, and parameters (--set) beside it" in capsys.readouterr().err
    assert start(app, [*words, "--replay"]) == FAULT
    said = " ".join(capsys.readouterr().err.split())
    assert "simulated controllers, and here are replayed actuators; expected the same in both: leave out" in said


@pytest.mark.slow
def test_persons_whom_nobody_counted_are_as_likely_in_residuals_as_in_the_calibration(house, house_recorded, tmp_path):
    day = house_recorded(tmp_path, hours=24, count=False, persons=(np.arange(144) % 48 > 30).astype(float))
    report = calibrate(house("me"), day, starts=1, warm_up=WARM_UP, replay=True).report
    found = residuals(house("me"), day, calibration=report, warm_up=WARM_UP, replay=True)
    assert found.assumed["N"] == "what the readings make most likely"
    assert found.outputs["room"]["rmse"] == pytest.approx(report.outputs["room"].rmse, rel=0.05)
