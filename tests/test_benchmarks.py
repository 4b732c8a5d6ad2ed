"""The benchmarks are run by hand, for hours: that they still can be is told here."""

import runpy
from pathlib import Path

import numpy as np
import pytest

SCRIPTS = Path(__file__).parent / "benchmarks"


@pytest.fixture
def beside(monkeypatch):
    """What a script finds when it is run: the files beside it."""
    monkeypatch.syspath_prepend(str(SCRIPTS))


@pytest.mark.parametrize("script", sorted(SCRIPTS.glob("*.py")), ids=lambda one: one.stem)
def test_a_benchmark_finds_all_that_it_imports(script, beside):
    assert runpy.run_path(str(script), run_name="tried")["__doc__"]


def test_a_room_to_forecast_is_read_as_a_recording(beside, default_system, tmp_path):
    unseen = runpy.run_path(str(SCRIPTS / "forecast.py"), run_name="tried")["unseen"]
    record = unseen(default_system, 5, 0, "sensor", 24.0, 24.0, tmp_path)
    assert record.outputs.shape == (len(default_system.outputs), 48)
    assert np.isfinite(record.outputs).all()
