"""What all tests share."""

from pathlib import Path

import pytest

from shared.system import load_system

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def default_system():
    """The default system, as users get it."""
    return load_system(ROOT / "fmus" / "MixedAirCO2")
