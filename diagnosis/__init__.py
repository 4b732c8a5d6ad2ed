"""From recordings to parameters, forecasts, and what the model still lacks.

The functions behind the commands: :func:`import_recording`, :func:`residuals`, :func:`calibrate`, :func:`forecast`,
:func:`diagnose`; and :func:`serve`, behind ``diagnosis app``.
:func:`read_recording` and :func:`read_calibration` read what they write.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shared.lazy import lazily

if TYPE_CHECKING:
    from diagnosis.app.server import serve as serve
    from diagnosis.calibrating.calibration import calibrate as calibrate
    from diagnosis.calibrating.schema import read_calibration as read_calibration
    from diagnosis.forecasting.forecast import forecast as forecast
    from diagnosis.gap.diagnosed import diagnose as diagnose
    from diagnosis.measurements.importer import import_recording as import_recording
    from diagnosis.recording import read_recording as read_recording
    from diagnosis.simulated import residuals as residuals

__all__ = [
    "calibrate",
    "diagnose",
    "forecast",
    "import_recording",
    "read_calibration",
    "read_recording",
    "residuals",
    "serve",
]

_HOMES = {
    "calibrate": "diagnosis.calibrating.calibration",
    "diagnose": "diagnosis.gap.diagnosed",
    "forecast": "diagnosis.forecasting.forecast",
    "import_recording": "diagnosis.measurements.importer",
    "read_calibration": "diagnosis.calibrating.schema",
    "read_recording": "diagnosis.recording",
    "residuals": "diagnosis.simulated",
    "serve": "diagnosis.app.server",
}

__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    """What tab completion offers."""
    return __all__
