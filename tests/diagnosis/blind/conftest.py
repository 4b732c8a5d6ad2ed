"""The truth of the default system, and a small set by hand."""

import pytest

import diagnosis.blind.running as running
from diagnosis.blind.truth import default_truth, load_truth
from tests.diagnosis.blind.blind_cases import hand_set


@pytest.fixture(scope="session")
def truth(default_system):
    return load_truth(default_truth(default_system), default_system)


@pytest.fixture
def one_program(monkeypatch):
    """Sources may be edited while tests run; what a run makes of that has a test of its own."""
    monkeypatch.setattr(running, "program", lambda: "program")


@pytest.fixture
def blind_set(tmp_path, default_system):
    return hand_set(tmp_path / "set", default_system, [3.0, 0.0, 3.0])[0]
