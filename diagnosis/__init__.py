"""From recordings to parameters, forecasts, and what the model still lacks.

The functions behind the commands: :func:`import_recording`, :func:`residuals`, :func:`calibrate`, :func:`forecast`.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "calibrate": "diagnosis.calibrating.calibration",
    "forecast": "diagnosis.forecasting.forecast",
    "import_recording": "diagnosis.importing.importer",
    "residuals": "diagnosis.simulated",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for and no more."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'diagnosis' has no attribute {name!r}")
