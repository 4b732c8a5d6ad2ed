"""What comparisons are made with."""

import pytest

from shared.system import load_system


@pytest.fixture(scope="session")
def default():
    """The default system."""
    return load_system("MixedAirCO2")
