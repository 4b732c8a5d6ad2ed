"""The pictures of a calibration's page."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.calibrating.report import _inputs


@pytest.mark.parametrize("inputs", [[], ["ambient"]])
def test_inputs_of_which_none_moves_are_an_empty_picture(monkeypatch, inputs):
    """A tank in a room whose temperature stays, whose persons were counted, or which has no inputs at all."""
    monkeypatch.setattr("diagnosis.calibrating.report.embedded", lambda made: made)
    problem = SimpleNamespace(
        system=SimpleNamespace(inputs=[SimpleNamespace(name=name, source="weather", unit="K") for name in inputs]),
        drive=SimpleNamespace(start=0.0, signals={name: SimpleNamespace(at=np.zeros_like) for name in inputs}),
        recording=SimpleNamespace(began="2001-01-01 00:00", step=3600.0),
        time=3600.0 * np.arange(1, 25),
        nuisance=SimpleNamespace(levels=()),
        size=0,
        values=np.asarray,
    )
    picture, rest = _inputs(SimpleNamespace(problem=problem, fit=SimpleNamespace(z=np.empty(0))))
    (panel,) = picture.axes
    assert not panel.lines and panel.get_xlabel().startswith("days since")
    assert rest == []
