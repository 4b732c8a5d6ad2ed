"""The simulation farm: samples systems, simulates FMUs, writes datasets.

The functions behind the commands of the same names: :func:`run`, :func:`simulate`, :func:`info`, :func:`verify`,
:func:`repair`, :func:`merge`, :func:`compare`, :func:`identifiability`.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

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


def __getattr__(name: str) -> Any:
    """Import what is asked for and no more: the command line's help should not wait for numba and Dask."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'datagen' has no attribute {name!r}")
