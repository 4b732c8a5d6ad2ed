"""The simulation farm: samples systems, simulates FMUs, writes datasets.

The functions behind the commands of the same names: :func:`describe`, :func:`run`, :func:`simulate`, :func:`info`,
:func:`verify`, :func:`repair`, :func:`merge`, :func:`copy`, :func:`compare`, :func:`identifiability`.
"""

from __future__ import annotations

from shared.lazy import lazily

_HOMES = {
    "describe": "datagen.fmi.describe",
    "run": "datagen.farming.farm",
    "simulate": "datagen.simulating.recording",
    "info": "datagen.datasets.inspection",
    "verify": "datagen.datasets.inspection",
    "merge": "datagen.datasets.merging",
    "repair": "datagen.datasets.mending",
    "compare": "datagen.comparing.comparison",
    "copy": "shared.remote",
    "identifiability": "datagen.limits.ceilings",
}

__getattr__ = lazily(__name__, _HOMES)
