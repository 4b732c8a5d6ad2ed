"""What all tests share."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

from shared.system import load_system

# new examples are for people who can look at what they find; CI repeats the ones it knows
settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def default_system():
    """The default system, as users get it."""
    return load_system(ROOT / "fmus" / "MixedAirCO2")
