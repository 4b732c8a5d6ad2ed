"""From a column mapping and a CSV of measurements to a recording: :func:`import_recording`."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    """Import what is asked for and no more."""
    if name == "import_recording":
        return import_module("diagnosis.measurements.importer").import_recording
    raise AttributeError(f"module 'diagnosis.measurements' has no attribute {name!r}")
