"""The pictures of a calibration's page."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.calibrating.report import _fit


def test_an_output_is_drawn_over_no_less_than_its_sensors_noise(monkeypatch):
    """A constant reading beside a model that misses it by a hundredth of the noise, and one that moves."""
    measured = np.array([np.full(24, 0.0697), np.linspace(18.0, 22.0, 24)])
    names = ["flow", "room"]
    problem = SimpleNamespace(
        system=SimpleNamespace(
            output_names=names, outputs=[SimpleNamespace(unit="kg/s"), SimpleNamespace(unit="degC")]
        ),
        measured=measured,
        floor=np.array([0.01, 0.1]),
        time=3600.0 * np.arange(1, 25),
        drive=SimpleNamespace(start=0.0),
        recording=SimpleNamespace(began="2001-01-01 00:00"),
    )
    done = SimpleNamespace(
        problem=problem,
        report=SimpleNamespace(outputs=dict.fromkeys(names, SimpleNamespace(used=True))),
        fit=SimpleNamespace(around=SimpleNamespace(outputs=measured + 0.0001)),
    )
    monkeypatch.setattr("diagnosis.calibrating.report.embedded", lambda made: made)
    still, moving = (axes.get_ylim() for axes in _fit(done).axes)
    assert (still[1] - still[0], 0.5 * sum(still)) == (pytest.approx(0.04), pytest.approx(0.06975))
    assert 4.0 < moving[1] - moving[0] < 5.0
