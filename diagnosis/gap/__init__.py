"""Where the gap between recording and model lies, which effect causes it, how far it shrinks: :func:`diagnose`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "diagnose": "diagnosis.gap.diagnosed",
    "Diagnosis": "diagnosis.gap.diagnosed",
    "Report": "diagnosis.gap.schema",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for and no more: the command line's help should not wait for the simulator."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'diagnosis.gap' has no attribute {name!r}")
