"""From recordings to parameters, forecasts, and what the model still lacks.

The functions behind the commands: :func:`import_recording`, :func:`residuals`, :func:`calibrate`, :func:`forecast`,
:func:`diagnose`; and :func:`serve`, behind ``diagnosis app``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shared.lazy import lazily

if TYPE_CHECKING:
    from diagnosis.app.server import serve as serve
    from diagnosis.calibrating.calibration import calibrate as calibrate
    from diagnosis.forecasting.forecast import forecast as forecast
    from diagnosis.gap.diagnosed import diagnose as diagnose
    from diagnosis.measurements.importer import import_recording as import_recording
    from diagnosis.simulated import residuals as residuals

__all__ = ["calibrate", "diagnose", "forecast", "import_recording", "residuals", "serve"]

_HOMES = {
    "calibrate": "diagnosis.calibrating.calibration",
    "diagnose": "diagnosis.gap.diagnosed",
    "forecast": "diagnosis.forecasting.forecast",
    "import_recording": "diagnosis.measurements.importer",
    "residuals": "diagnosis.simulated",
    "serve": "diagnosis.app.server",
}

__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    """What tab completion offers."""
    return __all__
