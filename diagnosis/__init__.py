"""From recordings to parameters, forecasts, and what the model still lacks.

The functions behind the commands: :func:`import_recording`, :func:`residuals`, :func:`calibrate`, :func:`forecast`,
:func:`diagnose`.
"""

from __future__ import annotations

from shared.lazy import lazily

_HOMES = {
    "calibrate": "diagnosis.calibrating.calibration",
    "diagnose": "diagnosis.gap.diagnosed",
    "forecast": "diagnosis.forecasting.forecast",
    "import_recording": "diagnosis.measurements.importer",
    "residuals": "diagnosis.simulated",
}

__getattr__ = lazily(__name__, _HOMES)
