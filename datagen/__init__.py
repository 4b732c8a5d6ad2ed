"""The simulation farm: samples systems, simulates FMUs, writes datasets.

The functions behind the commands of the same names: :func:`run`, :func:`simulate`, :func:`info`, :func:`verify`,
:func:`repair`, :func:`merge`, :func:`compare`, :func:`identifiability`.
"""

from __future__ import annotations

from shared.lazy import lazily

_HOMES = {
    "run": "datagen.farm",
    "simulate": "datagen.recording",
    "info": "datagen.inspection",
    "verify": "datagen.inspection",
    "merge": "datagen.merging",
    "repair": "datagen.mending",
    "compare": "datagen.comparing",
    "identifiability": "datagen.ceilings",
}

__getattr__ = lazily(__name__, _HOMES)
