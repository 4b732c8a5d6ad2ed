"""Where the gap between recording and model lies, which effect causes it, how far it shrinks: :func:`diagnose`."""

from __future__ import annotations

from shared.lazy import lazily

_HOMES = {
    "diagnose": "diagnosis.gap.diagnosed",
    "Diagnosis": "diagnosis.gap.diagnosed",
    "Report": "diagnosis.gap.schema",
}

__getattr__ = lazily(__name__, _HOMES)
