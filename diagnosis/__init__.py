"""From recordings to what the model still lacks. The function behind the command: :func:`residuals`."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    """Import what is asked for and no more."""
    if name == "residuals":
        return import_module("diagnosis.simulated").residuals
    raise AttributeError(f"module 'diagnosis' has no attribute {name!r}")
