"""The pictures of a calibration's page."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.calibrating.report import _inputs

NAMES = ["flow", "room"]


def done_with(measured, *, found=None):
    """A calibration of two outputs (outputs, steps) whose model misses them by a ten thousandth."""
    problem = SimpleNamespace(
        system=SimpleNamespace(
            output_names=NAMES,
            outputs=[
                SimpleNamespace(name="flow", long_name="air flow", unit="kg/s"),
                SimpleNamespace(name="room", long_name="", unit="degC"),
            ],
        ),
        measured=measured,
        floor=np.array([0.01, 0.1]),
        noise=SimpleNamespace(white=found),
        time=3600.0 * np.arange(1, 25),
        drive=SimpleNamespace(start=0.0),
        recording=SimpleNamespace(began="2001-01-01 00:00"),
    )
    return SimpleNamespace(
        problem=problem,
        report=SimpleNamespace(outputs=dict.fromkeys(NAMES, SimpleNamespace(used=True))),
        fit=SimpleNamespace(around=SimpleNamespace(outputs=measured + 0.0001)),
    )


def driven(done, signals):
    """The same calibration with signals by the inputs' names."""
    done.problem.recording.step, done.problem.size, done.problem.values = 3600.0, 0, np.asarray
    done.problem.system.inputs = [SimpleNamespace(name=name, source="weather", unit="K") for name in signals]
    done.problem.drive.signals = {name: SimpleNamespace(at=at) for name, at in signals.items()}
    done.problem.nuisance, done.fit.z = SimpleNamespace(levels=()), np.empty(0)
    return done


@pytest.mark.parametrize("inputs", [[], ["ambient"]])
def test_inputs_of_which_none_moves_are_an_empty_picture(monkeypatch, inputs):
    """A tank in a room whose temperature stays, whose persons were counted, or which has no inputs at all."""
    done = driven(done_with(np.zeros((2, 24))), dict.fromkeys(inputs, np.zeros_like))
    monkeypatch.setattr("diagnosis.calibrating.report.embedded", lambda made: made)
    picture, rest = _inputs(done)
    (panel,) = picture.axes
    assert not panel.lines and panel.get_xlabel().startswith("days since")
    assert rest == []
