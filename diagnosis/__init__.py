"""From recordings to parameters, forecasts, and what the model still lacks.

The functions behind the commands: :func:`draft_mapping`, :func:`import_recording`, :func:`residuals`,
:func:`calibrate`, :func:`forecast`, :func:`diagnose`; :func:`farm`, which calibrates what a diagnosis says of a system;
and :func:`serve`, behind ``diagnosis app``.
:func:`read_recording`, :func:`read_calibration` and :func:`read_report` read what they write.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from shared.lazy import lazily

if TYPE_CHECKING:
    from diagnosis.app.server import serve as serve
    from diagnosis.calibrating.calibration import calibrate as calibrate
    from diagnosis.calibrating.schema import read_calibration as read_calibration
    from diagnosis.farming.farm import farm as farm
    from diagnosis.forecasting.forecast import forecast as forecast
    from diagnosis.gap.diagnosed import diagnose as diagnose
    from diagnosis.gap.schema import read_report as read_report
    from diagnosis.measurements.draft import draft_mapping as draft_mapping
    from diagnosis.measurements.importer import import_recording as import_recording
    from diagnosis.recording import read_recording as read_recording
    from diagnosis.simulated import residuals as residuals

__all__ = [
    "calibrate",
    "diagnose",
    "draft_mapping",
    "farm",
    "forecast",
    "import_recording",
    "read_calibration",
    "read_recording",
    "read_report",
    "residuals",
    "serve",
]

_HOMES = {
    "calibrate": "diagnosis.calibrating.calibration",
    "diagnose": "diagnosis.gap.diagnosed",
    "draft_mapping": "diagnosis.measurements.draft",
    "farm": "diagnosis.farming.farm",
    "forecast": "diagnosis.forecasting.forecast",
    "import_recording": "diagnosis.measurements.importer",
    "read_calibration": "diagnosis.calibrating.schema",
    "read_recording": "diagnosis.recording",
    "read_report": "diagnosis.gap.schema",
    "residuals": "diagnosis.simulated",
    "serve": "diagnosis.app.server",
}

__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    """What tab completion offers."""
    return __all__
