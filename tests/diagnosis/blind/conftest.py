"""The truth of the default system."""

import pytest

from diagnosis.blind.truth import default_truth, load_truth


@pytest.fixture(scope="session")
def truth(default_system):
    return load_truth(default_truth(default_system), default_system)
