"""What is taken where nothing is said, by the command and by the functions behind it."""

FAILURE_BUDGET = 0.05
"""Share of systems that may fail before a run is stopped."""
TIMEOUT = 600.0
"""Seconds that one system may take before its process is killed."""
