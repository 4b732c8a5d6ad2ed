"""What a checker of the CF conventions that others wrote has to say of a file."""

from pathlib import Path

import pytest


def cf_faults(path: Path) -> set[str]:
    """Messages on a NetCDF file; the test is skipped where the checker is not installed."""
    pytest.importorskip("compliance_checker.runner")
    from compliance_checker.suite import CheckSuite

    CheckSuite.load_all_available_checkers()
    suite = CheckSuite()
    groups, errors = suite.run_all(suite.load_dataset(str(path)), ["cf:1.11"], skip_checks=[])["cf:1.11"]
    assert not errors
    return {message for group in groups for message in group.msgs if group.value[0] < group.value[1]}
